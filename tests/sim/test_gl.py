"""Machines that cannot render: one line says what would help, and everything else goes on."""

from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from sim_fakes import steps_to

from ik_client import Command, LoopState, TickReport
from ik_proto.robots import RobotDescription
from sim_client import gl
from sim_client.gl import PACKAGES, NoRendering
from sim_client.pictures import write_pictures
from sim_client.robot import SimRobot
from sim_client.settings import Settings
from sim_client.trace import Tick

find_backend = gl.find_backend.__wrapped__  # Without its memory.


def test_takes_the_first_that_works(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl.sys, "platform", "linux")
    tried: list[str] = []
    monkeypatch.setattr(gl, "_works", lambda backend: tried.append(backend) is None and backend == "osmesa")
    assert find_backend() == "osmesa"
    assert tried == ["egl", "osmesa"]


def test_takes_the_one_that_was_chosen_or_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "OSMesa")
    monkeypatch.setattr(gl, "_works", lambda backend: backend == "osmesa")
    assert find_backend() == "osmesa"
    monkeypatch.setattr(gl, "_works", lambda backend: backend == "egl")
    with pytest.raises(NoRendering):
        find_backend()


def test_names_the_packages_that_help(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "_works", lambda backend: False)
    with pytest.raises(NoRendering) as fault:
        find_backend()
    assert PACKAGES in str(fault.value)
    assert "\n" not in str(fault.value)


def test_can_be_turned_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(NoRendering, match="MUJOCO_GL=off turns rendering off"):
        find_backend()


def test_a_broken_backend_is_found_out_in_its_own_process() -> None:
    assert gl._works("no_such_backend") is False


def test_pictures_are_left_out_with_one_line(
    monkeypatch: pytest.MonkeyPatch, g1: RobotDescription, tmp_path: Path
) -> None:
    def fail() -> str:
        raise NoRendering(f"no pictures: apt install {PACKAGES}")

    monkeypatch.setattr("sim_client.offscreen.find_backend", fail)
    robot = SimRobot(g1)
    report = TickReport(
        0.0, LoopState.HOLDING, "no targets", Command(np.zeros(14), np.zeros(14), 0.0), steps_to(None, None)
    )
    tick = Tick(0, 0.02, report, robot.data.qpos.copy(), robot.wrists(), 0.0, 0.0)
    settings = Settings(url="tcp://x:1", video=tmp_path / "a.mp4", still=tmp_path / "a.png", eyes=tmp_path / "eyes")
    said: list[str] = []
    write_pictures(settings, g1, [tick], Console(file=StringIO()), said.append)
    assert said == [f"no pictures: apt install {PACKAGES}"]
    assert list(tmp_path.iterdir()) == []
