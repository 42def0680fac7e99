"""MediaPipe, where it is installed; else one line that says what to do."""

import importlib
import platform
from typing import Any


class NoMediaPipe(ValueError):
    """MediaPipe cannot be used here; says what to do, in one line."""


def mediapipe(module: str = "mediapipe") -> Any:
    """Import it, or a module of it.

    Args:
        module: Its full name.

    Returns:
        The module.

    Raises:
        NoMediaPipe: It is not installed, cannot be, or cannot be loaded.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        if platform.system() == "Linux" and platform.machine() in ("aarch64", "arm64"):
            raise NoMediaPipe(
                "MediaPipe 0.10.30 is not published for Linux on ARM: run ik-camera on an x86-64 computer"
            ) from None
        raise NoMediaPipe('MediaPipe is not installed: pip install "ik-service[camera]"') from None
    except (ImportError, OSError) as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise NoMediaPipe(
            f'MediaPipe cannot be loaded ({first}): pip install --force-reinstall "ik-service[camera]"'
        ) from None
