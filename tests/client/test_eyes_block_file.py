"""Named blocks: who may open them, and what becomes of those that a killed process leaves."""

import os
import signal
import stat
import subprocess
import sys
import uuid
from collections.abc import Iterator

import pytest

from ik_client.eyes import block_file
from ik_client.eyes.block_file import BlockError, attach, create, folder, held, remove, remove_if_left, sweep

SIZE = 4096


@pytest.fixture
def name() -> Iterator[str]:
    """A name that nobody else uses; the block is removed in the end."""
    made = f"{block_file.PREFIX}test-{uuid.uuid4().hex[:12]}"
    yield made
    (folder() / made).unlink(missing_ok=True)


def run(code: str) -> int:
    """Run code in another process, with the functions of `block_file`; its exit code."""
    start = f"import os, runpy\nglobals().update(runpy.run_path({block_file.__file__!r}))\n"
    return subprocess.run([sys.executable, "-I", "-S", "-c", start + code], check=False).returncode


def left_behind(name: str, then: str = "os.kill(os.getpid(), 9)") -> None:
    """A block whose publisher ended without a word."""
    assert run(f"create({name!r}, {SIZE}); {then}") in (0, -signal.SIGKILL)
    assert (folder() / name).exists()


def test_a_block_is_its_owners_alone(name):
    descriptor = create(name, SIZE)
    found = (folder() / name).stat()
    assert stat.S_IMODE(found.st_mode) == 0o600
    assert found.st_size == SIZE
    reader = attach(name, SIZE)
    assert held(reader)
    remove(descriptor, folder() / name)
    assert not held(reader)
    assert not (folder() / name).exists()
    os.close(reader)


def test_a_name_in_use_is_refused(name):
    descriptor = create(name, SIZE)
    with pytest.raises(BlockError, match="another process publishes there"):
        create(name, SIZE)
    assert not remove_if_left(folder() / name)
    sweep()
    assert (folder() / name).exists()
    remove(descriptor, folder() / name)


def test_a_block_of_a_killed_publisher_is_replaced(name):
    left_behind(name)
    with pytest.raises(BlockError, match="nobody publishes there on this machine"):
        attach(name, SIZE)
    descriptor = create(name, 2 * SIZE)
    os.close(attach(name, 2 * SIZE))
    remove(descriptor, folder() / name)


def test_left_over_blocks_are_swept_away(name):
    left_behind(name, "os._exit(0)")
    sweep()
    assert not (folder() / name).exists()


def test_a_reader_that_ends_takes_nothing_with_it(name):
    """What `multiprocessing.shared_memory` gets wrong up to Python 3.12."""
    descriptor = create(name, SIZE)
    for end, code in (("", 0), ("os.kill(os.getpid(), 9)", -signal.SIGKILL)):
        assert run(f"map_block(attach({name!r}, {SIZE}), {SIZE})\n{end}") == code
        assert (folder() / name).exists()
        os.close(attach(name, SIZE))
    remove(descriptor, folder() / name)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda path: path.chmod(0o644), "belongs to another user"),
        (lambda path: os.truncate(path, SIZE // 2), "another version"),
        (lambda path: (path.unlink(), path.symlink_to("/etc/passwd")), "symbolic links"),
        (lambda path: (path.unlink(), os.mkfifo(path, 0o600)), "belongs to another user"),
        (lambda path: path.unlink(), "nobody publishes there on this machine"),
    ],
)
def test_what_is_no_block_of_ours_is_not_opened(name, spoil, words):
    descriptor = create(name, SIZE)
    spoil(folder() / name)
    with pytest.raises(BlockError, match=words):
        attach(name, SIZE)
    os.close(descriptor)


def test_a_name_that_somebody_else_took_is_told_in_words(name):
    (folder() / name).symlink_to("/etc/passwd")
    with pytest.raises(BlockError):
        create(name, SIZE)
    assert (folder() / name).is_symlink()
