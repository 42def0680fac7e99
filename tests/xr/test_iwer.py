"""The emulated headset's script: fetched once, checked always. npm's part is played by small scripts."""

import os
import tarfile
from pathlib import Path

import pytest

from xr_client import iwer
from xr_client.iwer import EmulatorError, iwer_script


def play_npm(folder: Path, monkeypatch, script: str) -> None:
    """Put a program named npm before all others."""
    folder.mkdir()
    npm = folder / "npm"
    npm.write_text(f"#!/bin/sh\necho called >> {folder}/calls\n{script}\n")
    npm.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")


def packed(folder: Path, content: bytes, member: str = "package/build/iwer.min.js") -> Path:
    """A package as npm packs it."""
    (folder / "content").write_bytes(content)
    with tarfile.open(folder / "iwer.tgz", "w:gz") as package:
        package.add(folder / "content", member)
    return folder / "iwer.tgz"


@pytest.fixture
def published(tmp_path, monkeypatch) -> bytes:
    """What counts as published in this test."""
    content = b"globalThis.IWER = {};"
    monkeypatch.setattr(iwer, "_is_published", lambda script: script == content)
    return content


def test_it_is_fetched_once(tmp_path, monkeypatch, published):
    package = packed(tmp_path, published)
    play_npm(tmp_path / "bin", monkeypatch, f'test "$1 $2 $3" = "pack --silent iwer@{iwer.VERSION}" && cp {package} .')
    cache = tmp_path / "not" / "there" / "yet"
    first, second = iwer_script(cache), iwer_script(cache)
    assert first == second
    assert first.read_bytes() == published
    assert (tmp_path / "bin" / "calls").read_text() == "called\n"
    assert list(cache.iterdir()) == [first]


def test_the_users_cache_is_where_it_is_kept(tmp_path, monkeypatch, published):
    package = packed(tmp_path, published)
    play_npm(tmp_path / "bin", monkeypatch, f"cp {package} .")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert iwer_script().parent == tmp_path / "cache" / "ik-xr"


def test_something_else_is_refused_and_not_kept(tmp_path, monkeypatch):
    """The real checksum: this content has another one."""
    package = packed(tmp_path, b"globalThis.IWER = { evil: true };")
    play_npm(tmp_path / "bin", monkeypatch, f"cp {package} .")
    with pytest.raises(EmulatorError, match="as it was published") as caught:
        iwer_script(tmp_path / "cache")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "cache").exists()


def test_a_script_that_was_changed_is_not_served(tmp_path):
    cached = tmp_path / f"iwer-{iwer.VERSION}.min.js"
    cached.write_text("globalThis.IWER = {};")
    with pytest.raises(EmulatorError, match="delete it"):
        iwer_script(tmp_path)


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("echo first >&2; echo no such host >&2; exit 1", "no such host"),
        ("exit 3", "exit code 3"),
        ("true", "no package"),
        ("echo nonsense > iwer.tgz", "is no package"),
    ],
)
def test_npm_without_success_is_one_line(tmp_path, monkeypatch, script, said):
    play_npm(tmp_path / "bin", monkeypatch, script)
    with pytest.raises(EmulatorError, match=f"npm cannot fetch.*{said}") as caught:
        iwer_script(tmp_path / "cache")
    assert "\n" not in str(caught.value)


def test_a_package_without_the_script_is_one_line(tmp_path, monkeypatch):
    package = packed(tmp_path, b"", "package/README.md")
    play_npm(tmp_path / "bin", monkeypatch, f"cp {package} .")
    with pytest.raises(EmulatorError, match="npm cannot fetch"):
        iwer_script(tmp_path / "cache")


def test_without_npm_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(EmulatorError, match="install npm"):
        iwer_script(tmp_path / "cache")
