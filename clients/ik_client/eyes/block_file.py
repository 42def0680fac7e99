"""Named blocks of shared memory between processes of one user: files that live in memory.

- The publisher of a block holds a lock on its file for as long as it lives; the kernel lets go of it however the
  process ends. So anybody can tell a block in use from one that a killed process has left, which the next publisher
  removes.
- Only its owner may open a block (0600), and a block of anybody else is not opened: its name is no secret.
- `multiprocessing.shared_memory` does not serve here: up to Python 3.12 a reader that ends takes the block with it.
"""

import errno
import fcntl
import mmap
import os
import stat
import tempfile
import time
from pathlib import Path

PREFIX = "ik-eyes-"
"""What the names of a robot's blocks begin with; left-over blocks with it are removed."""

_ABSENT = (
    "nobody publishes there on this machine: the robot is starting or has ended, "
    "or it is on another machine and must use zenoh://HOST:PORT"
)
_TRIES = 20
_PAUSE = 0.005
_FLAGS = os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC


class BlockError(Exception):
    """A block cannot be had; says why, in words."""


def folder() -> Path:
    """Where the blocks of this machine are."""
    memory = Path("/dev/shm")
    return memory if memory.is_dir() else Path(tempfile.gettempdir())


def create(name: str, size: int) -> int:
    """Make a block and take its lock, in place of one that was left behind.

    Args:
        name: File name.
        size: Bytes, all zero.

    Returns:
        File descriptor that holds the lock.

    Raises:
        BlockError: The name is in use, or there is no memory.
    """
    path = folder() / name
    for _ in range(_TRIES):
        remove_if_left(path)
        try:
            descriptor = os.open(path, _FLAGS | os.O_CREAT | os.O_EXCL, 0o600)
        except FileExistsError:
            if not in_use(path):
                continue  # just made, or just being looked at
            raise BlockError("another process publishes there already") from None
        except OSError as error:
            raise BlockError(f"it cannot be made ({os.strerror(error.errno or 0).lower()})") from None
        # Between making and locking, somebody may have taken it for one that was left behind.
        if _locked(descriptor) and _is_at(descriptor, path):
            try:
                os.posix_fallocate(descriptor, 0, size)  # a full memory is an error now, not a crash at a write
            except OSError as error:
                remove(descriptor, path)
                raise BlockError(f"it cannot be made ({os.strerror(error.errno or 0).lower()})") from None
            return descriptor
        os.close(descriptor)
        time.sleep(_PAUSE)
    raise BlockError("others make and remove it at the same moment")


def attach(name: str, size: int) -> int:
    """Open a block that somebody publishes.

    Args:
        name: File name.
        size: Bytes that it must have.

    Returns:
        File descriptor.

    Raises:
        BlockError: There is none, it is somebody else's, or it is of another kind.
    """
    try:
        descriptor = os.open(folder() / name, _FLAGS)
    except FileNotFoundError:
        raise BlockError(_ABSENT) from None
    except OSError as error:
        strange = error.errno in (errno.EACCES, errno.EPERM)
        words = "it belongs to another user: run both as the same" if strange else os.strerror(error.errno or 0).lower()
        raise BlockError(words) from None
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o077:
        fault = "it belongs to another user: run both as the same"
    elif found.st_size != size:
        fault = "it is of another version"
    elif not held(descriptor):
        fault = _ABSENT
    else:
        return descriptor
    os.close(descriptor)
    raise BlockError(fault)


def map_block(descriptor: int, size: int) -> mmap.mmap:
    """A block as memory."""
    return mmap.mmap(descriptor, size)


def held(descriptor: int) -> bool:
    """Whether the publisher of an open block still lives."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(descriptor, fcntl.LOCK_UN)
    return False


def in_use(path: Path) -> bool:
    """Whether a block has a publisher that lives, or may have."""
    try:
        descriptor = os.open(path, _FLAGS)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    try:
        return held(descriptor)
    finally:
        os.close(descriptor)


def remove(descriptor: int, path: Path) -> None:
    """Remove a block of ours and let go of it."""
    if _is_at(descriptor, path):
        path.unlink()
    os.close(descriptor)


def remove_if_left(path: Path) -> bool:
    """Remove a block of ours whose publisher was killed, and say whether there was one."""
    try:
        descriptor = os.open(path, _FLAGS)
    except OSError:
        return False
    try:
        left = os.fstat(descriptor).st_uid == os.geteuid() and _locked(descriptor) and _is_at(descriptor, path)
        if left:
            path.unlink()
        return left
    finally:
        os.close(descriptor)


def sweep() -> None:
    """Remove all blocks of ours that were left behind."""
    for path in folder().glob(f"{PREFIX}*"):
        remove_if_left(path)


def _locked(descriptor: int) -> bool:
    """Take the lock, unless somebody has it."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether a name still means the file that was opened."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path, follow_symlinks=False))
    except FileNotFoundError:
        return False
