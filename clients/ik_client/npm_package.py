"""Files out of a published npm package, fetched once by the system's npm into the user's cache.

npm is asked for an exact version and runs nothing of it. Who asks knows the checksum of what they want.
"""

import os
import shutil
import subprocess
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path

_LIMIT = 120.0
"""How long npm may take [s]."""


class NpmError(ValueError):
    """The package cannot be had; one line that says why and what to do."""


def fetch_package(name: str, version: str, members: Sequence[str]) -> dict[str, bytes]:
    """Fetch a package.

    Args:
        name: Of the package.
        version: Exactly this one.
        members: Which of its files, `package/...`.

    Returns:
        Their contents, by member.

    Raises:
        NpmError: There is no npm, it does not succeed, or the package has no such file.
    """
    npm = shutil.which("npm")
    if npm is None:
        raise NpmError(f"npm is needed, once, to fetch {name} {version}: install npm")
    with tempfile.TemporaryDirectory() as folder:
        try:
            subprocess.run(
                [npm, "pack", "--silent", f"{name}@{version}", "--ignore-scripts"],
                cwd=folder,
                check=True,
                capture_output=True,
                timeout=_LIMIT,
            )
            with tarfile.open(next(Path(folder).glob("*.tgz"))) as package:
                return {member: _read(package, member) for member in members}
        except subprocess.CalledProcessError as error:
            said = error.stderr.decode(errors="replace").strip().splitlines()
            reason = said[-1] if said else f"exit code {error.returncode}"
        except StopIteration:
            reason = "it made no package"
        except tarfile.TarError:
            reason = "it made something that is no package"
        except (OSError, subprocess.TimeoutExpired, KeyError) as error:
            reason = str(error)
    raise NpmError(f"npm cannot fetch {name} {version} ({reason}): is there a network?")


def cache_folder(name: str) -> Path:
    """The folder of that name in the user's cache: in `$XDG_CACHE_HOME`, else `~/.cache`. It need not exist."""
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / name


def keep(file: Path, content: bytes) -> Path:
    """Put a file into a cache, whole or not at all: two processes may do this at the same time.

    Args:
        file: Where to; its folder is made, for the user only.
        content: What it holds.

    Returns:
        The file.

    Raises:
        OSError: It cannot be written.
    """
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=file.parent, delete=False) as part:
        try:
            part.write(content)
            part.flush()
            return Path(part.name).replace(file)
        except BaseException:
            Path(part.name).unlink(missing_ok=True)
            raise


def _read(package: tarfile.TarFile, member: str) -> bytes:
    content = package.extractfile(member)
    if content is None:
        raise KeyError(f"{member} is no file")
    return content.read()
