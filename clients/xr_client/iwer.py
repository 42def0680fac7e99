"""The emulated headset: IWER, Meta's implementation of WebXR in plain JavaScript (npm package `iwer`, MIT).

It is for trying things out and for tests, so it is no part of the distribution: npm fetches it once into a cache. What
is served must have the checksum written here, wherever it came from.
"""

import hashlib
from pathlib import Path

from ik_client.npm_package import NpmError, cache_folder, fetch_package, keep

VERSION = "2.5.0"
SHA256 = "23d8640949f19db4b1e70398b30e084e4aa555f3a81e4329da3fac1a70b39542"
"""Of `build/iwer.min.js` of that version."""

_MEMBER = "package/build/iwer.min.js"


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
    file = (cache or cache_folder("ik-xr")) / f"iwer-{VERSION}.min.js"
    if file.is_file():
        if not _is_published(file.read_bytes()):
            raise EmulatorError(f"{file} is not iwer {VERSION} as it was published: delete it and try again")
        return file
    try:
        script = fetch_package("iwer", VERSION, [_MEMBER])[_MEMBER]
    except NpmError as error:
        raise EmulatorError(f"--emulate: {error}") from None
    if not _is_published(script):
        raise EmulatorError(f"what npm fetched is not iwer {VERSION} as it was published: which registry does it ask?")
    return keep(file, script)


def _is_published(script: bytes) -> bool:
    return hashlib.sha256(script).hexdigest() == SHA256
