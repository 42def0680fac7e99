"""A plain tar that grows file by file, read and written from front to back.

Only what every tar has is allowed: a header of POSIX ustar and a regular file. Python's own reader follows links and
extensions, which a file from elsewhere may use against it, and takes a cut for an error.
"""

import os
import tarfile
from collections.abc import Callable, Iterator

END = bytes(2 * tarfile.BLOCKSIZE)
"""The end of an archive. It may be missing."""

_BLOCK = tarfile.BLOCKSIZE


class ArchiveError(ValueError):
    """Not such a tar; says why."""


class CutOff(Exception):
    """The archive ends within a file."""


def pack_file(name: str, content: bytes) -> bytes:
    """A file as it stands in an archive: a header, the content, zeros up to a whole block."""
    info = tarfile.TarInfo(name)
    info.size = len(content)
    return info.tobuf(tarfile.USTAR_FORMAT) + content + bytes(-len(content) % _BLOCK)


def read_files(descriptor: int, largest: Callable[[str], int]) -> Iterator[tuple[str, int, int]]:
    """Find the files of an archive.

    Args:
        descriptor: Of the open archive.
        largest: How long a file of this name may be [byte]; below 0 where there may be none.

    Yields:
        Name, beginning and size [byte] of every file that is whole.

    Raises:
        ArchiveError: It is no such tar.
        CutOff: It ends within a file; all whole files were given.
        OSError: It cannot be read.
    """
    end = os.fstat(descriptor).st_size
    at = 0
    while header := os.pread(descriptor, _BLOCK, at):
        if at > 0 and not any(header):
            return
        if len(header) < _BLOCK:
            raise CutOff
        try:
            info = tarfile.TarInfo.frombuf(header, "ascii", "strict")
        except (tarfile.HeaderError, ValueError):
            raise ArchiveError(f"it is no tar at byte {at}") from None
        if info.type not in (tarfile.REGTYPE, tarfile.AREGTYPE) or not 0 <= info.size <= largest(info.name):
            raise ArchiveError(f"it has no place for {info.name!r}")
        begin = at + _BLOCK
        if begin + info.size > end:
            raise CutOff
        yield info.name, begin, info.size
        at = begin + info.size + -info.size % _BLOCK
        if at > end:
            raise CutOff
