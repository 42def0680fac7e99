"""`TcpServer` on real sockets with an echo behind it: framing, limits, refusals and the way it closes.

Each test runs on both event loops. The server's limits are injected and small.
"""

import asyncio
import json
import struct

import pytest
from tcp_tools import Echo, Run, connect, echo_server, is_served, read_to_the_end, receive, refuse, until

from ik_proto import MAX_FRAME_BYTES, encode_frame
from ik_service.addresses import AddressInUse
from ik_service.tcp_server import TcpServer


def test_byte_by_byte(run: Run) -> None:
    async def main() -> None:
        async with echo_server() as (_, address):
            reader, writer = await connect(address)
            for byte in encode_frame(b"slow but complete"):
                writer.write(bytes([byte]))
                await writer.drain()
                await asyncio.sleep(0)
            assert await receive(reader) == b"echo slow but complete"
            writer.close()

    run(main())


def test_many_frames_in_one_write_are_answered_in_order(run: Run) -> None:
    async def main() -> None:
        async with echo_server() as (_, address):
            reader, writer = await connect(address)
            bodies = [str(index).encode() for index in range(200)]
            writer.write(b"".join(map(encode_frame, bodies)))
            assert [await receive(reader) for _ in bodies] == [b"echo " + body for body in bodies]
            writer.close()

    run(main())


def test_frames_cut_anywhere(run: Run) -> None:
    async def main() -> None:
        async with echo_server() as (_, address):
            stream = b"".join(map(encode_frame, (b"", b"a", b"bc" * 500)))
            for cut in range(1, 20):
                reader, writer = await connect(address)
                writer.write(stream[:cut])
                await writer.drain()
                await asyncio.sleep(0.001)
                writer.write(stream[cut:])
                assert [await receive(reader) for _ in range(3)] == [b"echo ", b"echo a", b"echo " + b"bc" * 500]
                writer.close()

    run(main())


@pytest.mark.parametrize("length", [MAX_FRAME_BYTES + 1, 2**32 - 1])
def test_a_length_beyond_the_limit_is_answered_then_closed(run: Run, length: int) -> None:
    async def main() -> None:
        async with echo_server() as (_, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b"before") + struct.pack(">I", length) + b"x" * 100_000)
            assert await receive(reader) == b"echo before"
            assert json.loads(await receive(reader))["status"] == "bad_request"
            assert await reader.read() == b""
            assert await is_served(address)
            writer.close()

    run(main())


def test_the_largest_frame_is_served(run: Run) -> None:
    async def main() -> None:
        async with echo_server() as (_, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b"y" * MAX_FRAME_BYTES))
            assert len(await receive(reader)) == MAX_FRAME_BYTES + len(b"echo ")
            writer.close()

    run(main())


def test_a_connection_too_many_is_told_and_closed(run: Run) -> None:
    async def main() -> None:
        async with echo_server(connections=2) as (server, address):
            served = [await connect(address) for _ in range(2)]
            await until(lambda: server.connections == 2)
            reader, writer = await connect(address)
            writer.write(encode_frame(b"let me in"))
            assert json.loads(await receive(reader))["status"] == "overloaded"
            assert await reader.read() == b""
            for reader, writer_served in served:
                writer_served.write(encode_frame(b"still here"))
                assert await receive(reader) == b"echo still here"
            writer.close()
            served[0][1].close()
            await until(lambda: server.connections == 1)
            assert await is_served(address)
            served[1][1].close()

    run(main())


def test_a_refused_client_that_stays_is_dropped(run: Run) -> None:
    async def main() -> None:
        async with echo_server(connections=0, linger_s=0.02) as (server, address):
            _, writer = await connect(address)
            await until(lambda: server.connections == 1)
            await until(lambda: server.connections == 0)
            writer.close()

    run(main())


@pytest.mark.parametrize("sent", [b"\x00", b"\x00\x00\x00\x64", encode_frame(b"complete") + b"\x00\x00\x00\x10half"])
def test_a_frame_that_does_not_complete_closes_the_connection(run: Run, sent: bytes) -> None:
    async def main() -> None:
        async with echo_server(frame_s=0.05) as (_, address):
            reader, writer = await connect(address)
            writer.write(sent)
            rest = await read_to_the_end(reader)
            assert rest == (encode_frame(b"echo complete") if b"complete" in sent else b"")
            assert await is_served(address)
            writer.close()

    run(main())


def test_an_idle_connection_outlives_the_frame_limit(run: Run) -> None:
    async def main() -> None:
        async with echo_server(frame_s=0.02) as (_, address):
            slow_reader, slow_writer = await connect(address)
            reader, writer = await connect(address)
            for body in (b"first", b"second"):
                writer.write(encode_frame(body))
                assert await receive(reader) == b"echo " + body
            # The limit has passed once a frame begun afterwards has been dropped for it.
            slow_writer.write(b"\x00")
            assert await read_to_the_end(slow_reader) == b""
            writer.write(encode_frame(b"third"))
            assert await receive(reader) == b"echo third"
            writer.close()
            slow_writer.close()

    run(main())


def test_a_client_that_never_reads_is_dropped(run: Run) -> None:
    async def main() -> None:
        async with echo_server(unread_bytes=10_000) as (server, address):
            _, writer = await connect(address)
            with pytest.raises(ConnectionError):
                await _write_for_ever(writer, encode_frame(b"z" * 60_000))
            await until(lambda: server.connections == 0)
            assert await is_served(address)

    run(main())


async def _write_for_ever(writer: asyncio.StreamWriter, frame: bytes) -> None:
    """Send without reading: first the buffers of both kernels fill up."""
    while True:
        writer.write(frame)
        await writer.drain()


def test_stop_answers_what_has_arrived(run: Run) -> None:
    async def main() -> None:
        async with echo_server() as (server, address):
            complete, begun = await connect(address), await connect(address)
            begun[1].write(encode_frame(b"begun")[:6])
            await until(lambda: server.connections == 2)
            complete[1].write(encode_frame(b"complete"))
            stopping = asyncio.create_task(server.stop(grace_s=5.0))
            await asyncio.sleep(0)
            begun[1].write(encode_frame(b"begun")[6:])
            assert await receive(complete[0]) == b"echo complete"
            assert await receive(begun[0]) == b"echo begun"
            await stopping
            assert server.connections == 0
            assert await complete[0].read() == b""
            with pytest.raises(ConnectionRefusedError):
                await connect(address)
            complete[1].close()
            begun[1].close()

    run(main())


def test_an_address_in_use_says_so(run: Run) -> None:
    async def main() -> None:
        async with echo_server() as (_, address):
            other = TcpServer(Echo, refuse)
            with pytest.raises(AddressInUse) as caught:
                await other.start(address)
            assert str(address) in str(caught.value)
            assert "--tcp" in str(caught.value)

    run(main())
