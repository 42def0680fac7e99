"""The emulated headset: IWER, Meta's implementation of WebXR in plain JavaScript (npm package `iwer`, MIT).

It is for trying things out and for tests, so it is no part of the distribution: npm fetches it once into a cache. What
is served must have the checksum written here, wherever it came from.
"""

import hashlib
import os
import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path

VERSION = "2.5.0"
SHA256 = "23d8640949f19db4b1e70398b30e084e4aa555f3a81e4329da3fac1a70b39542"
"""Of `build/iwer.min.js` of that version."""

_MEMBER = "package/build/iwer.min.js"
_FETCH_LIMIT = 120.0


class EmulatorError(ValueError):
    """The emulated headset cannot be had; one line that says what to do."""


def iwer_script(cache: Path | None = None) -> Path:
    """Find the script, or fetch it.

    Args:
        cache: Folder to keep it in; None takes `ik-xr` in the user's cache folder.

    Returns:
        The file.

    Raises:
        EmulatorError: It is not there and cannot be fetched, or is not what it should be.
    """
    folder = cache or Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "ik-xr"
    file = folder / f"iwer-{VERSION}.min.js"
    if file.is_file():
        if not _is_published(file.read_bytes()):
            raise EmulatorError(f"{file} is not iwer {VERSION} as it was published: delete it and try again")
        return file
    script = _fetch()
    if not _is_published(script):
        raise EmulatorError(f"what npm fetched is not iwer {VERSION} as it was published: which registry does it ask?")
    folder.mkdir(parents=True, exist_ok=True)
    # Renamed when it is whole: two processes may do this at the same time.
    with tempfile.NamedTemporaryFile(dir=folder, delete=False) as part:
        part.write(script)
    return Path(part.name).replace(file)


def _is_published(script: bytes) -> bool:
    return hashlib.sha256(script).hexdigest() == SHA256


def _fetch() -> bytes:
    npm = shutil.which("npm")
    if npm is None:
        raise EmulatorError(f"--emulate needs npm, once, to fetch the emulated headset (iwer {VERSION}): install npm")
    with tempfile.TemporaryDirectory() as folder:
        try:
            subprocess.run(
                [npm, "pack", "--silent", f"iwer@{VERSION}"],
                cwd=folder,
                check=True,
                capture_output=True,
                timeout=_FETCH_LIMIT,
            )
            with tarfile.open(next(Path(folder).glob("*.tgz"))) as package:
                member = package.extractfile(_MEMBER)
                assert member is not None
                return member.read()
        except subprocess.CalledProcessError as error:
            said = error.stderr.decode(errors="replace").strip().splitlines()
            reason = said[-1] if said else f"exit code {error.returncode}"
        except StopIteration:
            reason = "it made no package"
        except tarfile.TarError:
            reason = "it made something that is no package"
        except (OSError, subprocess.TimeoutExpired, KeyError) as error:
            reason = str(error)
    raise EmulatorError(f"npm cannot fetch iwer {VERSION} ({reason}): is there a network?")
