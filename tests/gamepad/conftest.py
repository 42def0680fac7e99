"""What the tests of ik-gamepad share: robots."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import running

pytest.importorskip("pygame")


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[str]:
    """Address of a simulated robot, standing at home; one for each test."""
    pytest.importorskip("mujoco")
    command = ["sim_client", "--listen", "127.0.0.1:0", "--headless", "--eyes-to", "off"]
    report = ["--report", tmp_path / "robot.json"]
    with running(*command, *report, log=tmp_path / "robot.log") as (process, ready):
        yield f"tcp://{ready['listen']}"
        process.terminate()
        process.wait(30)
