"""Which folders and files code is loaded from: real modes, and real owners where the suite runs as root."""

import os
import stat
from pathlib import Path

import pytest

from ik_service.private_folder import folder_fault, is_private

as_root = pytest.mark.skipif(os.getuid() != 0, reason="only root can give files away")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "above" / "kernels"


def test_what_is_missing_is_made_private(folder: Path) -> None:
    before = os.umask(0o000)  # the most generous there is
    try:
        assert folder_fault(folder) == ""
    finally:
        os.umask(before)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o755
    assert folder_fault(folder) == ""


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702, 0o1777])
def test_a_folder_others_can_write_to(folder: Path, mode: int) -> None:
    folder.mkdir(parents=True)
    folder.chmod(mode)
    assert "others can write to it" in folder_fault(folder)


@pytest.mark.parametrize("mode", [0o777, 0o775])
def test_a_folder_above_that_others_can_write_to(folder: Path, mode: int) -> None:
    assert folder_fault(folder) == ""
    folder.parent.chmod(mode)
    assert f"others can write to {folder.parent} above it" in folder_fault(folder)


def test_a_folder_above_with_the_sticky_bit_is_like_tmp(folder: Path) -> None:
    assert folder_fault(folder) == ""
    folder.parent.chmod(0o1777)
    assert folder_fault(folder) == ""


@as_root
def test_a_folder_of_another_user(folder: Path) -> None:
    assert folder_fault(folder) == ""
    os.chown(folder, 12345, 12345)
    assert folder_fault(folder) == "it belongs to another user"


@as_root
def test_a_folder_above_of_another_user(folder: Path) -> None:
    assert folder_fault(folder) == ""
    os.chown(folder.parent, 12345, 12345)
    assert folder_fault(folder) == f"{folder.parent} above it belongs to another user"


def test_a_link_in_the_way_leads_to_what_counts(folder: Path, tmp_path: Path) -> None:
    real = tmp_path / "real"
    real.mkdir()
    folder.parent.symlink_to(real)
    assert folder_fault(folder) == ""
    real.chmod(0o777)
    assert f"others can write to {real} above it" in folder_fault(folder)


@as_root
def test_a_link_of_another_user(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    folder.parent.symlink_to(tmp_path / "real")
    os.lchown(folder.parent, 12345, 12345)
    assert folder_fault(folder) == f"{folder.parent} above it belongs to another user"


def test_a_link_or_a_file_in_its_place(folder: Path, tmp_path: Path) -> None:
    folder.parent.mkdir()
    folder.symlink_to(tmp_path)
    assert folder_fault(folder) == "it is not a folder"
    folder.unlink()
    folder.write_text("in the way")
    assert folder_fault(folder)


def test_a_relative_path_is_looked_at_up_to_the_root(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.parent.mkdir()
    monkeypatch.chdir(folder.parent)
    assert folder_fault(Path("kernels")) == ""
    folder.parent.chmod(0o777)
    assert folder_fault(Path("kernels"))


def test_a_file_is_ours_alone_to_write(tmp_path: Path) -> None:
    file, link = tmp_path / "kernel.so", tmp_path / "link.so"
    assert not is_private(file)
    file.write_bytes(b"code")
    file.chmod(0o644)
    link.symlink_to(file)
    assert is_private(file)
    assert not is_private(link)
    for mode in (0o664, 0o646):
        file.chmod(mode)
        assert not is_private(file)


@as_root
def test_a_file_of_another_user(tmp_path: Path) -> None:
    file = tmp_path / "kernel.so"
    file.write_bytes(b"code")
    os.chown(file, 12345, 12345)
    assert not is_private(file)
