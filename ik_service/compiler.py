"""C source to shared library, compiled once per machine.

Compiled libraries live in a per-user folder: `$IK_CACHE_DIR`, else `$XDG_CACHE_HOME/ik-service`, else
`~/.cache/ik-service`. Because a library from there is executed, the folder must belong to this user, and nobody else
may be able to write to it or to the folders above it. One that is not so is refused, and the library is built in a
private temporary folder instead; where that cannot be trusted either, there is none.

The name of a library is a hash of everything that decides its content: source, compiler, flags and CPU. The file ends
in the SHA-256 of what comes before it, which the dynamic loader ignores; a truncated or altered file, and one that is
not ours alone to write, is rebuilt.
Files appear by rename, so two services that start together cannot see half a library.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ik_service.private_folder import folder_fault, is_private

FLAGS = ("-std=gnu89", "-O3", "-march=native", "-fno-math-errno", "-fno-semantic-interposition", "-fPIC", "-shared")
"""Compiler flags. Not -ffast-math: the kernel relies on comparisons with NaN and on exact limits. In C89, CasADi writes
minimum and maximum as comparisons, one instruction each; no function may be replaced from outside, so that these and
others are inlined, which halves the time of a distance."""

COMPILE_TIMEOUT = 120.0
"""Time after which a compiler is given up [s]; it takes about 2 s."""

_DIGEST_BYTES = hashlib.sha256().digest_size


class CompileError(RuntimeError):
    """No library could be made; one line that says why."""


@dataclass(frozen=True)
class Library:
    """A shared library ready to load.

    Attributes:
        path: The file. It may be gone once the `library` context ends; a loaded library stays loaded.
        note: Why the cache was not used, else empty.
    """

    path: Path
    note: str = ""


@contextmanager
def library(source: str, folder: Path | None = None) -> Generator[Library]:
    """Provide the shared library of a C source, from the cache or freshly compiled.

    Args:
        source: C source text.
        folder: Cache folder; None for the per-user one.

    Yields:
        The library.

    Raises:
        CompileError: No compiler, or it failed.
    """
    compiler = _find_compiler()
    folder = folder or cache_folder()
    fault = folder_fault(folder)
    if not fault:
        path = folder / f"{_key(source, compiler)}.so"
        if not _is_intact(path):
            _compile(source, compiler, path)
        yield Library(path)
        return
    with tempfile.TemporaryDirectory(prefix="ik-service-") as private:
        if second_fault := folder_fault(Path(private)):
            raise CompileError(f"kernel cache {folder} not used: {fault}; nor {private}: {second_fault}")
        path = Path(private) / "kernel.so"
        _compile(source, compiler, path)
        yield Library(path, f"kernel cache {folder} not used: {fault}")


def cache_folder() -> Path:
    """Name the per-user folder of compiled libraries; it need not exist."""
    if chosen := os.environ.get("IK_CACHE_DIR"):
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "ik-service"


def _find_compiler() -> str:
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and (path := shutil.which(name)):
            return path
    raise CompileError("no C compiler found (looked for $CC, cc, gcc, clang)")


def _key(source: str, compiler: str) -> str:
    parts = (source, os.path.realpath(compiler), _version(compiler), " ".join(FLAGS), _cpu())
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


def _version(compiler: str) -> str:
    try:
        answer = subprocess.run([compiler, "--version"], capture_output=True, timeout=10.0, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        raise CompileError(f"{compiler} does not run ({type(error).__name__})") from None
    return answer.stdout.decode(errors="replace")


def _cpu() -> str:
    """What -march=native sees: instruction sets and model of the first core."""
    try:
        cores = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    wanted = ("vendor_id", "cpu family", "model", "stepping", "flags", "Features", "CPU implementer", "CPU part")
    first = cores.split("\n\n", 1)[0].splitlines()
    return "\n".join(line for line in first if line.split(":")[0].strip() in wanted)


def _is_intact(path: Path) -> bool:
    if not is_private(path):
        return False
    try:
        content = path.read_bytes()
    except OSError:
        return False
    return hashlib.sha256(content[:-_DIGEST_BYTES]).digest() == content[-_DIGEST_BYTES:]


def _compile(source: str, compiler: str, path: Path) -> None:
    handle, name = tempfile.mkstemp(suffix=".so", prefix=".building-", dir=path.parent)
    os.close(handle)
    building = Path(name)
    try:
        command = [compiler, *FLAGS, "-x", "c", "-", "-o", name, "-lm"]
        subprocess.run(command, input=source.encode(), capture_output=True, timeout=COMPILE_TIMEOUT, check=True)
        content = building.read_bytes()
        if not content:
            raise CompileError(f"{compiler} wrote nothing")
        building.write_bytes(content + hashlib.sha256(content).digest())
        building.replace(path)
    except subprocess.CalledProcessError as error:
        lines = error.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        raise CompileError(f"{compiler} failed: {lines[0]}") from None
    except (OSError, subprocess.SubprocessError) as error:
        raise CompileError(f"{compiler} failed: {type(error).__name__}") from None
    finally:
        building.unlink(missing_ok=True)
