"""One virtual environment a peer, built by uv from the lock beside this file.

They live in `.venv/` beside the lock. uv hard-links packages from its cache, so the second build takes seconds.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
TIMEOUT_S = 900.0


class Unavailable(Exception):
    """A peer that cannot be had here; the message is one line and says why."""


def prepare(group: str) -> Path:
    """Build or bring up to date the environment of a dependency group.

    Args:
        group: A group of `pyproject.toml`.

    Returns:
        Its Python interpreter.

    Raises:
        Unavailable: uv is missing, or the group does not install.
    """
    uv = shutil.which("uv")
    if uv is None:
        raise Unavailable("not installed: uv, which builds the peers' environments, is not on the path")
    folder = FOLDER / ".venv" / group
    command = [uv, "sync", "--locked", "--quiet", "--project", str(FOLDER), "--only-group", group]
    variables = {**os.environ, "UV_PROJECT_ENVIRONMENT": str(folder)}
    variables.pop("VIRTUAL_ENV", None)
    try:
        result = subprocess.run(
            [*command, "--python", sys.executable], env=variables, capture_output=True, text=True, timeout=TIMEOUT_S
        )
    except subprocess.TimeoutExpired:
        raise Unavailable(f"not installed: no end after {TIMEOUT_S:.0f} s") from None
    if result.returncode:
        raise Unavailable(f"not installed: {_reason(result.stderr)}")
    return folder / "bin" / "python"


def _reason(output: str) -> str:
    """The gist of uv's complaint in one line."""
    lines = [line.strip(" ×│├─▶╰") for line in output.splitlines()]
    told = [line for line in lines if line and not line.startswith(("warning", "hint"))]
    return " ".join(told[:3])[:240] or "uv gives no reason"
