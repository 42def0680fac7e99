"""A cache of what npm fetched: whole or not at all. How npm is asked is tested with who asks, see test_iwer.py."""

import stat
from pathlib import Path

import pytest

from ik_client.npm_package import cache_folder, keep


def test_a_file_is_kept_for_the_user_only(tmp_path):
    file = keep(tmp_path / "new" / "file", b"content")
    assert file.read_bytes() == b"content"
    assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
    assert list(file.parent.iterdir()) == [file]


def test_a_file_that_cannot_be_put_in_place_leaves_nothing(tmp_path, monkeypatch):
    def replace(self: Path, target: Path) -> Path:
        raise OSError("no")

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(OSError, match="no"):
        keep(tmp_path / "file", b"content")
    assert list(tmp_path.iterdir()) == []


def test_the_cache_is_the_users(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder("ik-test") == tmp_path / "ik-test"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder("ik-test") == tmp_path / ".cache" / "ik-test"
