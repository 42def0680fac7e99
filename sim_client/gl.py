"""Finds an OpenGL that renders without a display.

Each candidate is tried in a process of its own: one that fails may take its process down, and two of them do not share
one. Where none works the simulator runs all the same, without pictures.
"""

import functools
import importlib
import os
import subprocess
import sys
from typing import Any

PACKAGES = "libegl1 libosmesa6 libgl1-mesa-dri"
"""Debian packages that give pictures on a machine without a graphics card."""

_TRIAL = "import sys; from sim_client.gl import open_context; open_context(sys.argv[1], 64, 64).make_current()"
_TRIAL_LIMIT = 30.0
_OFF = ("off", "disable", "disabled", "false", "0")


class NoRendering(RuntimeError):
    """This machine cannot render off screen; one line that says what would help."""


@functools.cache
def find_backend() -> str:
    """Choose how to render: what `MUJOCO_GL` names, else the first that works.

    Returns:
        Name of a MuJoCo OpenGL backend.

    Raises:
        NoRendering: None works, or `MUJOCO_GL` turns rendering off.
    """
    candidates = backends()
    for backend in candidates:
        if _works(backend):
            return backend
    raise none_works(candidates)


def backends() -> tuple[str, ...]:
    """The backends to try, in this order: what `MUJOCO_GL` names, else those that do without a display.

    Raises:
        NoRendering: `MUJOCO_GL` turns rendering off.
    """
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen in _OFF:
        raise NoRendering(f"no pictures: MUJOCO_GL={chosen} turns rendering off")
    return (chosen,) if chosen else ("egl", "osmesa") if sys.platform == "linux" else ("glfw",)


def none_works(candidates: tuple[str, ...]) -> NoRendering:
    """What to say where none of them works."""
    tried = " and ".join(candidates)
    return NoRendering(f"no pictures: OpenGL ({tried}) does not work here; on Debian or Ubuntu: apt install {PACKAGES}")


def open_context(backend: str, width: int, height: int) -> Any:
    """Open an off-screen OpenGL context of a backend.

    Args:
        backend: "egl", "osmesa" or "glfw".
        width: Width of its buffer [pixel].
        height: Height of its buffer [pixel].

    Returns:
        A context with `make_current()` and `free()`.
    """
    return importlib.import_module(f"mujoco.{backend}").GLContext(width, height)


def _works(backend: str) -> bool:
    try:
        trial = subprocess.run([sys.executable, "-P", "-c", _TRIAL, backend], capture_output=True, timeout=_TRIAL_LIMIT)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return trial.returncode == 0
