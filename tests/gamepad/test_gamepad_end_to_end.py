"""From a stick to the simulated robot's wrists: pad, `ik-gamepad`, service and robot, all real processes."""

import json
import os
import signal
import time

import numpy as np
from hands_on import LIMIT, HandsOn, hands_on

from ik_client import IKClient
from ik_proto import Array

SIDE = 0.06
"""Of the square that the left hand goes round [m]."""

ROLL = 0.25
BEFORE = f"left_shoulder_roll_joint = {ROLL}\nright_shoulder_roll_joint = -{ROLL}\n"
"""A posture with the forearms forward and off the body, from which the hands can go every way."""


def go_home(pad: HandsOn) -> None:
    """Hold the button until the arms rest at home."""
    home = np.zeros(14)
    home[1], home[8] = ROLL, -ROLL
    pad.do("button", "west", 1)
    pad.until(lambda: np.abs(pad.setpoint() - home).max() < 0.01, "the arms are at home")
    pad.do("button", "west", 0)
    pad.comes_to_rest()
    assert pad.state().following


def drive(pad: HandsOn, axis: str, value: float, along: int) -> Array:
    """Hold a stick until the left wrist has gone a side of the square, and wait for it to rest; gives where."""
    start = pad.wrists()[0]
    pad.do("axis", axis, value)
    pad.until(lambda: abs(pad.wrists()[0][along, 3] - start[along, 3]) >= SIDE, "a side of the square")
    pad.do("axis", axis, 0.0)
    pad.comes_to_rest()
    assert pad.state().following
    return pad.wrists()[0]


def turned(a: Array, b: Array) -> float:
    """Angle between two poses [rad]."""
    return float(np.arccos(np.clip((np.trace(a[:3, :3].T @ b[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))


def sides(commands: Array, ik: IKClient) -> list[Array]:
    """The left wrist's poses at the commands of each side, shape (k, 4, 4): from one push of the stick to the next."""
    asked = commands[:, 1:4]
    moves = np.flatnonzero(np.linalg.norm(asked, axis=1) > 0.05)
    pushes = [k for k, before in zip(moves[1:], moves, strict=False) if asked[k] @ asked[before] < 1e-9]
    parts = np.split(commands[moves[0] :], np.array(pushes) - moves[0])
    return [np.array([ik.fk(q).left_wrist for q in part[::4, 4:]]) for part in parts]


def test_a_stick_leads_a_hand_round_a_square_and_home(service_process, robot, tmp_path):
    home, report, commands = tmp_path / "home.toml", tmp_path / "report.json", tmp_path / "commands.npy"
    home.write_text(BEFORE)
    options = ("--commands", commands, "--home", home, "--report", report, "--speed", 0.1, "--release")
    with hands_on(service_process.tcp_url, robot, *options, log=tmp_path / "log") as pad:
        assert pad.ready["device"] == "Virtual Controller"
        pad.engage()
        go_home(pad)
        begin = pad.wrists()
        corners = [  # forward on a stick is -y; left is -x
            begin[0],
            drive(pad, "left_stick_y", -1.0, 0),
            drive(pad, "left_stick_x", -1.0, 1),
            drive(pad, "left_stick_y", 1.0, 0),
            drive(pad, "left_stick_x", 1.0, 1),
        ]
        end = pad.wrists()
        pad.process.send_signal(signal.SIGINT)
        said, _ = pad.process.communicate(timeout=LIMIT)
        paths = sides(np.load(commands), pad.ik)
    assert pad.process.returncode == 0, (tmp_path / "log").read_text()
    assert "the robot has taken its arms back" in said

    # Where the robot stood at the corners, and what it was sent on the sides.
    assert len(paths) == 4
    signs = ((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0))
    for before, after, path, (along, sign) in zip(corners[:-1], corners[1:], paths, signs, strict=True):
        assert sign * (after - before)[along, 3] >= SIDE
        for poses in (np.array([before, after]), path):
            across = np.delete(poses[:, :3, 3] - poses[0, :3, 3], along, axis=1)
            assert np.linalg.norm(across, axis=1).max() < 0.003, "the side of the square is not straight"
            assert max(turned(begin[0], pose) for pose in poses) < np.radians(1.0)
    # The other hand has stayed where it was.
    assert np.linalg.norm(end[1][:3, 3] - begin[1][:3, 3]) < 1e-3

    numbers = json.loads(report.read_text())
    assert numbers["engagements"] >= 1
    assert numbers["step_at_rest"] < 1e-9
    assert numbers["stages_ms"]["service"]["n"] > 100


def test_unplugged_it_holds_and_plugged_in_again_it_waits_for_a_press(service_process, robot, tmp_path):
    """Hazard: switch gone."""
    with hands_on(service_process.tcp_url, robot, log=tmp_path / "log") as pad:
        pad.engage()
        pad.do("axis", "left_stick_y", -1.0)
        pad.until(lambda: not pad.rests(0.05), "the arms move")
        pad.do("unplug")
        pad.until(lambda: not pad.state().following, "the robot is told to hold")
        pad.comes_to_rest()
        pad.do("plug")
        pad.do("button", "left_shoulder", 1)
        pad.do("axis", "left_stick_y", -1.0)
        assert pad.rests(1.0)
        assert not pad.state().following
        pad.engage()
        pad.do("axis", "left_stick_y", -1.0)
        pad.until(lambda: not pad.rests(0.05), "the arms move again")
        pad.do("button", "left_shoulder", 0)
        pad.comes_to_rest()


def test_with_the_service_killed_it_holds_and_with_another_one_it_waits_for_a_press(start_service, robot, tmp_path):
    first = start_service()
    with hands_on(first.tcp_url, robot, log=tmp_path / "log") as pad:
        pad.engage()
        pad.do("axis", "left_stick_y", -0.6)
        pad.until(lambda: not pad.rests(0.05), "the arms move")
        first.process.kill()
        pad.until(lambda: not pad.state().following, "the robot is told to hold")
        pad.comes_to_rest()
        host, port = first.tcp
        second = start_service("--tcp", f"{host}:{port}")
        assert second.ready["boot_id"] != first.ready["boot_id"]
        assert pad.rests(1.5)  # switch and stick are held all the time
        assert not pad.state().following
        pad.engage()
        pad.until(lambda: not pad.rests(0.05), "the arms move again")
        pad.process.send_signal(signal.SIGTERM)
        pad.process.communicate(timeout=LIMIT)
    assert pad.process.returncode == 0


def test_killed_itself_the_robot_holds(service_process, robot, tmp_path):
    with hands_on(service_process.tcp_url, robot, log=tmp_path / "log") as pad:
        pad.engage()
        pad.do("axis", "right_stick_y", -1.0)
        end = time.monotonic() + LIMIT
        while pad.rests(0.05):
            assert time.monotonic() < end
        os.kill(pad.process.pid, signal.SIGKILL)
        while not pad.rests():
            assert time.monotonic() < end
        assert not pad.state().following


def test_keys_move_the_hands_and_turning_to_another_window_lets_go(service_process, robot, tmp_path):
    """The keyboard's window, on a display that nobody sees."""
    options = ("--keyboard", "--speed", 0.1)
    env = {"SDL_VIDEODRIVER": "dummy"}
    with hands_on(service_process.tcp_url, robot, *options, log=tmp_path / "log", env=env) as pad:
        assert (pad.ready["device"], pad.ready["window"]) == ("keyboard", True)
        pad.engage("key", "space")
        before = pad.wrists()
        pad.do("key", "i", 1)  # the right hand, forward
        pad.until(lambda: pad.wrists()[1][0, 3] > before[1][0, 3] + 0.01, "the right hand moves forward")
        pad.do("focus", 0)
        pad.until(lambda: not pad.state().following, "the robot is told to hold")
        pad.comes_to_rest()
        pad.do("focus", 1)
        assert pad.rests(0.5)
        pad.do("key", "escape", 1)
        pad.process.communicate(timeout=LIMIT)
    assert pad.process.returncode == 0
