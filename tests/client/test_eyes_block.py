"""The block of shared memory: what is read is whole, whoever writes at the same moment."""

import mmap
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.eyes import block as block_module
from ik_client.eyes.block import PacketBlock, block_bytes

CAPACITY = 64
SIZE = block_bytes(CAPACITY)


@pytest.fixture
def block():
    made = PacketBlock(mmap.mmap(-1, SIZE), CAPACITY)
    made.prepare()
    yield made
    made.close()


def test_the_newest_packet_is_read_and_the_one_before_it_still_can_be(block):
    assert block.valid
    assert block.newest == 0
    for packet in (b"one", b"the second", b""):
        block.write(packet)
    assert block.newest == 3
    assert [block.read(number) for number in (1, 2, 3, 4)] == [None, b"the second", b"", None]
    with pytest.raises(ValueError, match="at most 64 bytes"):
        block.write(bytes(65))


@given(st.binary(max_size=CAPACITY), st.integers(0, SIZE - 1), st.integers(1, 255))
def test_a_byte_that_is_not_what_was_written_is_noticed(packet, place, change):
    """Any byte, of numbers, length, checksum or data: what is read is what was written, or nothing."""
    memory = mmap.mmap(-1, SIZE)
    block = PacketBlock(memory, CAPACITY)
    block.prepare()
    block.write(packet)
    memory[place] ^= change
    assert block.read(1) in (packet, None)
    block.close()


@given(st.binary(min_size=SIZE, max_size=SIZE), st.integers(0, 2**64 - 1))
def test_anything_may_be_in_a_block(content, number):
    memory = mmap.mmap(-1, SIZE)
    memory[:] = content
    block = PacketBlock(memory, CAPACITY)
    packet = block.read(number)
    assert packet is None or len(packet) <= CAPACITY
    block.close()


WRITER = """
import mmap, runpy, sys
globals().update(runpy.run_path(sys.argv[2]))
capacity = 1 << 16
block = PacketBlock(mmap.mmap(int(sys.argv[1]), block_bytes(capacity)), capacity)
block.prepare()
while True:
    number = block.newest + 1
    block.write(number.to_bytes(8, "little") * (1 + number * 997 % (capacity // 8)))
"""


def test_a_reader_beside_a_writer_takes_whole_packets_only(tmp_path):
    """A process writes without a pause, packets of all sizes; each repeats its own number."""
    capacity = 1 << 16
    with (tmp_path / "block").open("w+b") as file:
        file.truncate(block_bytes(capacity))
        command = [sys.executable, "-I", "-S", "-c", WRITER, str(file.fileno()), block_module.__file__]
        writer = subprocess.Popen(command, pass_fds=[file.fileno()])
        block = PacketBlock(mmap.mmap(file.fileno(), block_bytes(capacity)), capacity)
        try:
            last, whole, end = 0, 0, time.monotonic() + 30.0
            while whole < 2000:
                assert time.monotonic() < end
                number = block.newest
                packet = block.read(number) if number else None
                if packet is not None:
                    assert packet == number.to_bytes(8, "little") * (1 + number * 997 % (capacity // 8))
                    assert number >= last
                    last, whole = number, whole + 1
        finally:
            writer.kill()
            writer.wait()
            block.close()
