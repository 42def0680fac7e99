"""The rendered people of the camera client's tests, for benchmarks: they are data and a renderer, and no part of it."""

import importlib
import os
import sys
from pathlib import Path
from types import ModuleType

REPO = Path(__file__).resolve().parents[1]


def rendered(name: str) -> ModuleType:
    """A module of tests/camera."""
    folder = str(REPO / "tests" / "camera")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    return importlib.import_module(name)


def person_folder() -> Path | None:
    """Folder with a person's mesh and texture; None where it is absent."""
    folder = Path(os.environ.get("IK_DATA", REPO.parent / "shared" / "data")) / "camera"
    return folder if (folder / "human.npz").is_file() else None
