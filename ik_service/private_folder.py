"""Whether code in a folder can be trusted: whether only its owner and root can change it or put other in its place.

Who can write to a folder can rename what is in it, so the folders above count as well. In one with the sticky bit, such
as /tmp, only the owner of an entry can. A link counts like a folder: who owns it can turn it elsewhere.
"""

import os
import stat
from pathlib import Path

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def folder_fault(folder: Path) -> str:
    """Create a private folder if need be, and say why code from it cannot be trusted.

    Args:
        folder: The folder; one that is created gets mode 0700, and those above it that are missing 0755.

    Returns:
        The reason, in a few words; empty where it can be trusted.
    """
    folder = folder.absolute()
    try:
        for missing in reversed([parent for parent in folder.parents if not parent.exists()]):
            missing.mkdir(mode=0o755, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode):
            return "it is not a folder"
        return _entry_fault(status, "it") or _parents_fault(folder) or _access_fault(folder)
    except OSError as error:
        return error.strerror or str(error)


def is_private(file: Path) -> bool:
    """Whether a file, of which the folder is trusted, is one of ours that nobody else can write to."""
    try:
        status = file.lstat()
    except OSError:
        return False
    return stat.S_ISREG(status.st_mode) and not _entry_fault(status, "")


def _entry_fault(status: os.stat_result, name: str) -> str:
    if status.st_uid != os.getuid():
        return f"{name} belongs to another user"
    return f"others can write to {name} (chmod go-w it)" if status.st_mode & _OTHERS_WRITE else ""


def _parents_fault(folder: Path) -> str:
    """The fault of the folders above, along the path as it is written and along the one it leads to."""
    for parent in dict.fromkeys((*folder.parents, *folder.resolve().parents)):
        status = parent.lstat()
        if status.st_uid not in (os.getuid(), 0):
            return f"{parent} above it belongs to another user"
        sticky = status.st_mode & stat.S_ISVTX
        if stat.S_ISDIR(status.st_mode) and status.st_mode & _OTHERS_WRITE and not sticky:
            return f"others can write to {parent} above it (chmod go-w it)"
    return ""


def _access_fault(folder: Path) -> str:
    return "" if os.access(folder, os.W_OK | os.X_OK) else "it is not writable"
