"""What the tests of the camera client share."""

import fcntl
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from rendered_person import RenderedPerson
from scenes import open_scene

from camera_client.models import ensure_model


@pytest.fixture(scope="session")
def person_folder(shared_data: Path) -> Path:
    """Folder with the mesh and the texture of a person."""
    folder = shared_data / "camera"
    if not (folder / "human.npz").is_file():
        pytest.skip(f"no person to render in {folder}")
    return folder


@pytest.fixture(scope="module")
def scene(person_folder: Path) -> Iterator[RenderedPerson]:
    """The person as it was measured, before a level camera."""
    with open_scene(person_folder) as rendered:
        yield rendered


@pytest.fixture(scope="session")
def npm() -> None:
    """The test needs npm; where there is none it is skipped, but not in CI."""
    if shutil.which("npm") is None and not os.environ.get("CI"):
        pytest.skip("no npm: on Debian or Ubuntu, apt install npm")


@pytest.fixture(scope="session")
def pose_model(npm: None, run_folder: Path) -> Path:
    """The pose model *full* in the user's cache, made by whichever process of this run asks first."""
    with (run_folder / "models.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return ensure_model("full")
