"""A pad in the hands of a test: `ik-gamepad` as a real process, its pad SDL's virtual one, its robot watched."""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ik_client import IKClient, RobotState
from ik_client.robot_end import RobotLink, RobotSilent
from ik_proto import Array

LIMIT = 60.0
PROGRAM = Path(__file__).resolve().parent / "pad_process.py"
ENVIRONMENT = {
    name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY", "IK_TOKEN")
}


class HandsOn:
    """A running `ik-gamepad`."""

    def __init__(self, process: subprocess.Popen[str], ready: dict[str, Any], link: RobotLink, ik: IKClient) -> None:
        self.process, self.ready, self.link, self.ik = process, ready, link, ik

    def do(self, *words: object) -> None:
        """Move a control."""
        assert self.process.stdin is not None
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()

    def state(self) -> RobotState:
        """What the robot says; a busy machine lets even it wait."""
        end = time.monotonic() + LIMIT
        while True:
            try:
                return self.link.read()
            except RobotSilent:
                assert time.monotonic() < end
                time.sleep(0.01)

    def setpoint(self) -> Array:
        """Where the robot holds its joints, shape (14,) [rad]; or where they are."""
        state = self.state()
        return np.asarray(state.q if state.q_set is None else state.q_set)

    def wrists(self) -> Array:
        """Where the robot holds its wrists, left and right, shape (2, 4, 4): the set-point, with the waist straight."""
        reply = self.ik.fk(self.setpoint())
        return np.array([reply.left_wrist, reply.right_wrist])

    def until(self, reached: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + LIMIT
        while not reached():
            assert self.process.poll() is None, "ik-gamepad has ended"
            assert time.monotonic() < end, f"never: {what}; {self.state()}"
            time.sleep(0.005)

    def engage(self, *press: object) -> None:
        """Press the hold-to-run switch anew until the arms follow; a busy machine may lose a press."""
        words = press or ("button", "left_shoulder")
        self.until(lambda: self.state().ready, "the robot is ready")
        end = time.monotonic() + LIMIT
        while not self.state().following:
            assert time.monotonic() < end, f"the arms never follow; {self.state()}"
            self.do(*words, 0)
            time.sleep(0.1)
            self.do(*words, 1)
            for _ in range(100):
                if self.state().following:
                    break
                time.sleep(0.01)

    def rests(self, seconds: float = 0.5) -> bool:
        """Whether the set-point stands still for a while."""
        before = self.state().q_set
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            now = self.state().q_set
            if before is None or now is None or not np.array_equal(now, before):
                return False
            time.sleep(0.01)
        return True

    def comes_to_rest(self) -> None:
        self.until(self.rests, "the arms come to rest")


@contextmanager
def hands_on(
    service: str, robot: str, *options: object, log: Path, env: dict[str, str] | None = None
) -> Generator[HandsOn]:
    """Start `ik-gamepad` for a service and a robot."""
    command = [sys.executable, PROGRAM, "--service", service, "--robot", robot, *options]
    with (
        log.open("w") as errors,
        subprocess.Popen(
            [str(part) for part in command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env={**ENVIRONMENT, **(env or {})},
        ) as process,
    ):
        assert process.stdout is not None
        try:
            assert select.select([process.stdout], [], [], LIMIT)[0], log.read_text()
            line = process.stdout.readline()
            assert line, log.read_text()
            with RobotLink(robot) as link, IKClient(service, timeout=2.0) as ik:
                yield HandsOn(process, json.loads(line), link, ik)
        finally:
            process.kill()
