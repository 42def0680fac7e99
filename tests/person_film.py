"""A recording of a rendered person for tests outside of tests/camera."""

import importlib
import sys
from pathlib import Path

import pytest

_CAMERA = Path(__file__).resolve().parent / "camera"


def film_t_pose(path: Path, shared_data: Path) -> Path:
    """Film somebody who holds a T pose for as long as calibrating takes; the switch is held from 0.5 s on."""
    if not (shared_data / "camera" / "human.npz").is_file():
        pytest.skip(f"no person to render in {shared_data / 'camera'}")
    if str(_CAMERA) not in sys.path:
        sys.path.insert(0, str(_CAMERA))
    choreography, filmed, scenes = (importlib.import_module(name) for name in ("choreography", "filmed", "scenes"))
    dance = choreography.Choreography(
        ((0.0, "hang", "hang"), (0.8, "hang", "hang"), (1.5, "T", "T"), (4.6, "T", "T")), (0.0, 0.0), (0.0, 0.0)
    )
    with scenes.open_scene(shared_data / "camera") as scene:
        return filmed.film(path, scene, dance, lambda t: t >= 0.5, fps=12.0)
