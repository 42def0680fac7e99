"""Opens rendered people for tests, which are skipped where nothing can be rendered."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rendered_person import RenderedPerson
from skinned_person import Person

from sim_client.gl import NoRendering


@contextmanager
def open_scene(folder: Path, stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Generator[RenderedPerson]:
    """Render the person of a folder, stretched along the axes."""
    try:
        rendered = RenderedPerson(Person(folder / "human.npz", stretch), folder / "human.png")
    except NoRendering as fault:
        pytest.skip(str(fault))
    try:
        yield rendered
    finally:
        rendered.close()
