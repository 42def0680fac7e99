"""What the tests of the camera client share."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from rendered_person import RenderedPerson
from scenes import open_scene


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
