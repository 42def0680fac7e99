"""The token on disk and in the environment: written privately, never overwritten, refused where others can read it."""

import os
import stat
from pathlib import Path

import pytest

from ik_service.config import ConfigError
from ik_service.token_file import read_token, write_token


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_token(tmp_path / "ik.token")
    return tmp_path / "ik.token"


def test_a_written_token_is_private_long_and_read_back(file: Path, tmp_path: Path) -> None:
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    token = read_token(str(file), {})
    assert token == file.read_bytes().strip()
    assert len(token) >= 43  # 256 bits
    write_token(tmp_path / "another")
    assert read_token(str(tmp_path / "another"), {}) != token


def test_a_file_is_never_overwritten(file: Path) -> None:
    before = file.read_bytes()
    with pytest.raises(ConfigError, match="is not overwritten"):
        write_token(file)
    assert file.read_bytes() == before


def test_one_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be written"):
        write_token(tmp_path / "no such folder" / "ik.token")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o644, 0o620])
def test_a_file_others_can_use_is_refused(file: Path, mode: int) -> None:
    """Hazard row: auth."""
    file.chmod(mode)
    with pytest.raises(ConfigError, match=r"others can read the token file .*: chmod 600 it"):
        read_token(str(file), {})


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a file away")
def test_a_file_of_another_user_is_refused(file: Path) -> None:
    os.chown(file, 12345, 12345)
    with pytest.raises(ConfigError, match="belongs to another user"):
        read_token(str(file), {})


def test_the_environment_serves_where_no_file_is_named(file: Path) -> None:
    environment = {"IK_TOKEN": "from-the-environment"}
    assert read_token("", environment) == b"from-the-environment"
    assert read_token(str(file), environment) == file.read_bytes().strip()
    assert read_token("", {}) is None


@pytest.mark.parametrize("text", ["", " \n", "short", "x" * 257, "with a space in it", "é" * 20, "tab\tinside-it-all"])
def test_what_makes_no_token_is_refused_in_one_line_that_does_not_repeat_it(tmp_path: Path, text: str) -> None:
    """An empty variable, too: a forgotten value must not leave the door open."""
    file = tmp_path / "ik.token"
    file.touch(0o600)
    file.write_text(text, encoding="utf-8")
    for name, environment in ((str(file), {}), ("", {"IK_TOKEN": text})):
        with pytest.raises(ConfigError, match="16 to 256 printable ASCII characters") as caught:
            read_token(name, environment)
        assert "\n" not in str(caught.value)
        assert not text.strip() or text.strip() not in str(caught.value)


@pytest.mark.parametrize(("content", "words"), [(None, "cannot be read"), (b"\xff" * 30, "something else")])
def test_what_cannot_be_read_is_one_line(tmp_path: Path, content: bytes | None, words: str) -> None:
    file = tmp_path / "ik.token"
    if content is not None:
        file.touch(0o600)
        file.write_bytes(content)
    with pytest.raises(ConfigError, match=words):
        read_token(str(file), {})
