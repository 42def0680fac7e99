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
import signal
import subprocess
import tempfile
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from ik_service.private_folder import folder_fault, is_private

FLAGS = ("-std=gnu89", "-O3", "-march=native", "-fno-math-errno", "-fno-semantic-interposition", "-fPIC", "-shared")
"""Compiler flags. Not -ffast-math: the kernel relies on comparisons with NaN and on exact limits. In C89, CasADi writes
minimum and maximum as comparisons, one instruction each; no function may be replaced from outside, so that these and
others are inlined, which halves the time of a distance."""

COMPILE_TIMEOUT = 120.0
"""Time after which a compiler is given up [s]; it takes some seconds."""

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
def build(source: str, folder: Path | None = None) -> Generator[Callable[[], Library]]:
    """Begin to provide the shared library of a C source: from the cache, or freshly compiled beside this process.

    Args:
        source: C source text.
        folder: Cache folder; None for the per-user one.

    Yields:
        What waits for the library and returns it. A compiler that still runs at the end of the context is stopped.

    Raises:
        CompileError: No compiler, or, when it is waited for, it failed.
    """
    compiler = _find_compiler()
    folder = folder or cache_folder()
    with ExitStack() as stack:
        if fault := folder_fault(folder):
            private = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="ik-service-")))
            if second_fault := folder_fault(private):
                raise CompileError(f"kernel cache {folder} not used: {fault}; nor {private}: {second_fault}")
            made = Library(private / "kernel.so", f"kernel cache {folder} not used: {fault}")
        else:
            made = Library(folder / f"{_key(source, compiler)}.so")
        if not fault and _is_intact(made.path):
            yield lambda: made
            return
        finish = stack.enter_context(_compiling(source, compiler, made.path))

        def wait() -> Library:
            finish()
            return made

        yield wait


@contextmanager
def library(source: str, folder: Path | None = None) -> Generator[Library]:
    """Provide the shared library of a C source; as `build`, but waits for it."""
    with build(source, folder) as wait:
        yield wait()


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


@contextmanager
def _compiling(source: str, compiler: str, path: Path) -> Generator[Callable[[], None]]:
    """Start a compiler; what is yielded waits for it and puts the library in its place."""
    handle, name = tempfile.mkstemp(suffix=".so", prefix=".building-", dir=path.parent)
    os.close(handle)
    building = Path(name)
    try:
        process = _start([compiler, *FLAGS, "-x", "c", "-", "-o", name, "-lm"], source)
        try:
            yield lambda: _finish(process, building, path)
        finally:
            _stop(process)
    finally:
        building.unlink(missing_ok=True)


def _start(command: list[str], source: str) -> subprocess.Popen[bytes]:
    try:
        with tempfile.TemporaryFile() as file:
            file.write(source.encode())
            file.seek(0)
            # A group of its own: the program that was started starts others, which have to end with it.
            return subprocess.Popen(
                command, stdin=file, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, process_group=0
            )
    except OSError as error:
        raise CompileError(f"{command[0]} failed: {type(error).__name__}") from None


def _finish(process: subprocess.Popen[bytes], building: Path, path: Path) -> None:
    compiler = str(process.args[0])  # ty: ignore[not-subscriptable]
    try:
        _, errors = process.communicate(timeout=COMPILE_TIMEOUT)
        if process.returncode:
            lines = errors.decode(errors="replace").strip().splitlines() or ["no message"]
            raise CompileError(f"{compiler} failed: {lines[0]}")
        content = building.read_bytes()
        if not content:
            raise CompileError(f"{compiler} wrote nothing")
        building.write_bytes(content + hashlib.sha256(content).digest())
        building.replace(path)
    except (OSError, subprocess.SubprocessError) as error:
        raise CompileError(f"{compiler} failed: {type(error).__name__}") from None


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End a compiler and what it has started, unless it has ended by itself."""
    if process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
    with process:  # waits, and closes its pipe
        pass
