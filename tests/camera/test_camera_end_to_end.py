"""A rendered person, MediaPipe, `ik-camera`, service and a simulated robot, all of them real: it mirrors the person.

The operator is calibrated first, as every operator should be.

What the robot measures goes through MuJoCo's kinematics; what the person does is known exactly.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from choreography import Choreography
from filmed import film
from mirror_rig import PRESS, QUICK, STILL, Limbs, Watcher, angles, person_directions
from processes import LIMIT, running
from rendered_person import RenderedPerson

from camera_client.models import ModelError, ensure_model
from ik_client.joint_limiter import MotionLimits

FAR = 12.0
"""How far a limb of the robot may point from where the person's does [deg]."""
SPEED = 0.5
"""How many times faster than it was the recording is played: slower, as this machine has other tests to run."""
ATTEMPTS, COUNTED = 4, 2
"""Attempts at most, and how many of them may be seen in time and still miss. On a busy machine frames are late, are
guessed forward, and may be lost; the arms hold then, as they must, and the attempt does not count. Of twelve that
counted one came to 12.0 degrees, the others to 8 to 11.8: the raised arm."""
FPS = 25.0
T_POSE = Choreography(keys=((0.0, "T", "T"), (7.0, "T", "T")))
"""What the operator is calibrated on."""
CALIBRATION_FPS = 15.0


@pytest.fixture(scope="module")
def model() -> Path:
    """The pose model."""
    try:
        return ensure_model("full")
    except ModelError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def recording(scene: RenderedPerson, model: Path, tmp_path_factory) -> Path:
    """A T pose, both arms forward, the right arm up; the switch is pressed before."""
    return film(tmp_path_factory.mktemp("film") / "quick.ikcam", scene, QUICK, lambda t: t >= PRESS, fps=FPS)


@pytest.fixture(scope="module")
def operator(scene: RenderedPerson, model: Path, tmp_path_factory) -> Path:
    """Folder of the settings of a user who has calibrated as "ada"."""
    folder = tmp_path_factory.mktemp("settings")
    recording = film(folder / "t-pose.ikcam", scene, T_POSE, fps=CALIBRATION_FPS, seed=1)
    said = ik_camera(folder, "calibrate", "--user", "ada", "--replay", str(recording))
    assert "upper arm" in said
    return folder


def ik_camera(settings: Path, *arguments: str) -> str:
    """What `ik-camera` says to a user whose settings are in a folder."""
    command = [sys.executable, "-m", "camera_client", *arguments]
    environment = {**os.environ, "XDG_CONFIG_HOME": str(settings)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=2 * LIMIT, env=environment)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


def run(service: str, robot: str, recording: Path, operator: Path, report: Path) -> str:
    """What `ik-camera run --replay` says."""
    ends = ("--service", service, "--robot", robot, "--report", str(report), "--no-preview")
    return ik_camera(operator, "run", "--user", "ada", "--replay", str(recording), "--replay-speed", str(SPEED), *ends)


def seen_angles(watcher: Watcher, first: float) -> dict[str, np.ndarray]:
    """Angles between the limbs of robot and person while the person stood still, by posture, shape (2, 2) [deg]."""
    limbs, out = Limbs(), {}
    for posture, (begin, end) in STILL.items():
        then = watcher.between(first + begin / SPEED, first + end / SPEED)
        assert len(then) > 5
        directions = np.median([limbs.directions(one) for one in then], axis=0)
        out[posture] = angles(directions, person_directions(QUICK, 0.5 * (begin + end)))
    return out


def within(far: dict[str, np.ndarray]) -> bool:
    """Whether no limb points elsewhere than the person's."""
    return all(angle.max() <= FAR for angle in far.values())


def seen_in_time(said: str, report: dict[str, Any]) -> bool:
    """Whether the arms followed all the time, and nearly all frames were used while they were fresh."""
    used = report["frames"]["seen"] > 0.9 * FPS * QUICK.duration
    return said.count("arm: active") == 2 and used and report["stages_ms"]["whole"]["p95"] < 100.0


def test_the_robot_mirrors_a_person(recording, operator, service_process, tmp_path):
    seen: list[dict[str, np.ndarray]] = []
    written, robot_written = tmp_path / "camera.json", tmp_path / "robot.json"
    command = ("sim_client", "--listen", "127.0.0.1:0", "--headless", "--eyes-to", "off", "--report", robot_written)
    with running(*command, log=tmp_path / "robot.log") as (process, ready):
        url = f"tcp://{ready['listen']}"
        for _ in range(ATTEMPTS):
            with Watcher(url) as watcher:
                said = run(service_process.tcp_url, url, recording, operator, written)
            report = json.loads(written.read_text())
            if seen_in_time(said, report):
                seen.append(seen_angles(watcher, report["frames"]["first"]))
                if len(seen) == COUNTED or within(seen[-1]):
                    break
        process.terminate()
        process.communicate(timeout=LIMIT)
    if not seen:
        pytest.skip(f"this machine is too busy to see in time: {report['stages_ms']['whole']}")
    assert within(seen[-1]), (seen, said)
    assert report["frames"]["with_a_body"] == report["frames"]["seen"] > 100
    assert set(report["stages_ms"]) == {"camera", "landmarks", "lift", "filter", "wait", "ik", "command", "whole"}
    # Home first, then to the operator, then with the operator; in the end the arms hold.
    for words in ("coming to your posture", "following", "the source has ended", "the robot holds its arms"):
        assert words in said
    assert report["step_at_rest"] <= 1e-9
    limits = MotionLimits()
    numbers = json.loads(robot_written.read_text())
    assert 0.0 < numbers["largest_velocity"] <= limits.velocity * (1 + 1e-5)
    assert numbers["largest_acceleration"] <= limits.acceleration * (1 + 1e-5)
    assert numbers["step_while_disarmed"] <= 1e-9
