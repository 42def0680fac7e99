"""The cache of compiled libraries: built once, never trusted blindly, safe with two builders."""

import ctypes
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from ik_service import compiler
from ik_service.compiler import CompileError, build, cache_folder, library

SOURCE = "double answer(void) { return 42.0; }"

pytestmark = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="needs a C compiler (Debian package gcc)"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "kernels"


def _answer(path: Path) -> float:
    loaded = ctypes.CDLL(str(path))
    loaded.answer.restype = ctypes.c_double
    return loaded.answer()


def _build(folder: Path, source: str = SOURCE) -> Path:
    with library(source, folder) as built:
        assert built.note == ""
        return built.path


def test_builds_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _build(folder)
    assert _answer(path) == 42.0
    assert list(folder.iterdir()) == [path]
    monkeypatch.setattr(compiler, "_compiling", lambda *_: pytest.fail("compiled again"))
    assert _build(folder) == path


def test_folder_is_private(folder: Path) -> None:
    _build(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("change", ["source", "flags", "cpu", "compiler"])
def test_name_follows_what_decides_the_content(folder: Path, monkeypatch: pytest.MonkeyPatch, change: str) -> None:
    first = _build(folder)
    source = SOURCE + "/* */" if change == "source" else SOURCE
    if change == "flags":
        monkeypatch.setattr(compiler, "FLAGS", (*compiler.FLAGS, "-g0"))
    if change == "cpu":
        monkeypatch.setattr(compiler, "_cpu", lambda: "another")
    if change == "compiler":
        monkeypatch.setattr(compiler, "_version", lambda _: "another")
    assert _build(folder, source) != first


@pytest.mark.parametrize("damage", ["truncated", "flipped", "empty", "foreign"])
def test_damaged_library_is_rebuilt(folder: Path, damage: str) -> None:
    path = _build(folder)
    good = path.read_bytes()
    flipped = bytes([good[0], good[1] ^ 1]) + good[2:]
    bad = {"truncated": good[: len(good) // 2], "flipped": flipped, "empty": b"", "foreign": b"#!/bin/sh\n"}
    path.write_bytes(bad[damage])
    assert _build(folder) == path
    assert _answer(path) == 42.0
    assert path.read_bytes() == good


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
def test_folder_others_can_write_to_is_refused(folder: Path, mode: int) -> None:
    trap = _build(folder)
    trap.write_bytes(b"trap")
    folder.chmod(mode)
    with library(SOURCE, folder) as built:
        assert built.path.parent != folder
        assert "others can write to it" in built.note
        assert "\n" not in built.note
        assert _answer(built.path) == 42.0
        assert stat.S_IMODE(built.path.parent.stat().st_mode) == 0o700
    assert not built.path.exists()
    assert trap.read_bytes() == b"trap"


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder away")
def test_folder_of_another_user_is_refused(folder: Path) -> None:
    trap = _build(folder)
    os.chown(folder, 12345, 12345)
    trap.write_bytes(b"trap")
    with library(SOURCE, folder) as built:
        assert "belongs to another user" in built.note
        assert _answer(built.path) == 42.0
    assert trap.read_bytes() == b"trap"


def test_folder_below_one_that_others_can_write_to_is_refused(folder: Path) -> None:
    _build(folder / "kernels")
    folder.chmod(0o777)
    with library(SOURCE, folder / "kernels") as built:
        assert f"others can write to {folder} above it" in built.note
        assert built.path.parent != folder / "kernels"


def test_library_that_others_can_write_to_is_rebuilt(folder: Path) -> None:
    path = _build(folder)
    path.chmod(0o666)
    mark = path.stat().st_ino
    assert _build(folder) == path
    assert path.stat().st_ino != mark
    assert not path.stat().st_mode & 0o022


def test_link_instead_of_library_is_replaced(folder: Path, tmp_path: Path) -> None:
    path = _build(folder)
    path.rename(tmp_path / "elsewhere.so")
    path.symlink_to(tmp_path / "elsewhere.so")
    assert _build(folder) == path
    assert not path.is_symlink()


def test_without_any_trusted_folder_there_is_no_library(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp").chmod(0o777)  # no sticky bit
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    folder.mkdir(mode=0o777)
    folder.chmod(0o777)
    with pytest.raises(CompileError, match="not used: others can write to it") as caught, library(SOURCE, folder):
        pass
    assert "\n" not in str(caught.value)


def test_link_instead_of_folder_is_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    folder.symlink_to(tmp_path / "elsewhere")
    with library(SOURCE, folder) as built:
        assert "not a folder" in built.note
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_file_instead_of_folder_is_refused(folder: Path) -> None:
    folder.write_text("in the way")
    with library(SOURCE, folder) as built:
        assert built.note
        assert _answer(built.path) == 42.0


def test_no_compiler_is_one_line(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(CompileError, match="no C compiler found"), library(SOURCE, folder):
        pass


@pytest.mark.parametrize("script", ["exit 1", "echo fake 1.0", "[ $1 = --version ] || exit 1"])
def test_broken_compiler_is_one_line(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str
) -> None:
    fake = tmp_path / "fakecc"
    fake.write_text(f"#!/bin/sh\n{script}\n")
    fake.chmod(0o755)
    monkeypatch.setenv("CC", str(fake))
    with pytest.raises(CompileError) as caught, library(SOURCE, folder):
        pass
    assert "\n" not in str(caught.value)
    assert not folder.exists() or list(folder.iterdir()) == []


def test_source_that_does_not_compile_leaves_nothing_behind(folder: Path) -> None:
    with pytest.raises(CompileError, match="error"), library("this is not C", folder):
        pass
    assert list(folder.iterdir()) == []


def test_cache_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("IK_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache_folder() == tmp_path / ".cache" / "ik-service"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "ik-service"
    monkeypatch.setenv("IK_CACHE_DIR", str(tmp_path / "mine"))
    assert cache_folder() == tmp_path / "mine"


SLOW = """#!/bin/sh
[ "$1" = --version ] && exec echo slow 1.0
: > "{started}.$$"
while [ "$(ls {started}.* | wc -l)" -lt 2 ]; do sleep 0.01; done
exec cc "$@"
"""


def test_two_libraries_are_compiled_at_the_same_time(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The compiler waits until it runs twice: one after the other would never end."""
    slow = tmp_path / "slowcc"
    slow.write_text(SLOW.format(started=tmp_path / "started"))
    slow.chmod(0o755)
    monkeypatch.setenv("CC", str(slow))
    monkeypatch.setattr(compiler, "COMPILE_TIMEOUT", 30.0)
    with build(SOURCE, folder) as first, build(SOURCE.replace("42", "43"), folder) as second:
        assert [_answer(wait().path) for wait in (first, second)] == [42.0, 43.0]


ENDLESS = """#!/bin/sh
[ "$1" = --version ] && exec echo endless 1.0
sleep 1000 &
echo "$! $$" > {ids}
wait
"""


@pytest.mark.parametrize("how", ["given up", "timed out"])
def test_compiler_that_is_not_waited_for_is_stopped(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    """With what it has started, and nothing stays behind."""
    endless, ids = tmp_path / "endlesscc", tmp_path / "ids"
    endless.write_text(ENDLESS.format(ids=ids))
    endless.chmod(0o755)
    monkeypatch.setenv("CC", str(endless))
    monkeypatch.setattr(compiler, "COMPILE_TIMEOUT", 0.1)
    with build(SOURCE, folder) as wait:
        end = time.monotonic() + 30.0
        while not (ids.exists() and ids.read_text().endswith("\n")):
            assert time.monotonic() < end
            time.sleep(0.01)
        if how == "timed out":
            with pytest.raises(CompileError, match="TimeoutExpired"):
                wait()
    for process in ids.read_text().split():
        status = Path(f"/proc/{process}/stat")
        while status.exists() and status.read_text().rsplit(")")[1].split()[0] != "Z":
            assert time.monotonic() < end
            time.sleep(0.01)
    assert list(folder.iterdir()) == []


def test_two_builders_at_once(folder: Path) -> None:
    """Whoever finishes last replaces the file by an equal one; both load a whole library."""
    program = (
        "import ctypes, sys; from pathlib import Path; from ik_service.compiler import library\n"
        "with library(sys.argv[1], Path(sys.argv[2])) as built:\n"
        "    f = ctypes.CDLL(str(built.path)).answer; f.restype = ctypes.c_double; print(f(), built.note)\n"
    )
    command = [sys.executable, "-c", program, SOURCE, str(folder)]
    builders = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(4)]
    answers = [builder.communicate(timeout=60)[0] for builder in builders]
    assert [answer.split() for answer in answers] == [["42.0"]] * 4
    assert len(list(folder.iterdir())) == 1
