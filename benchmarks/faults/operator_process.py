"""An operator in a process of its own: moves both hands along a path and holds the grips, through a real teleop loop.

    python -m benchmarks.faults.operator_process SERVICE_URL ROBOT_URL DIARY.jsonl

When the arms are disarmed the operator lets go, waits a moment, and grips again. What the grips do and whether the
robot follows goes to the diary at once, a line each, with the time of CLOCK_MONOTONIC, so that it is there after a
SIGKILL too. SIGTERM gives the arms back to the robot and ends the process.
"""

import json
import os
import signal
import sys
import time
from pathlib import Path

from ik_client import (
    ArmEngagement,
    ArmState,
    Hands,
    HandSample,
    IKClient,
    TeleopLoop,
    TickReport,
)
from ik_client.joint_limiter import JointLimiter
from ik_client.robot_end import RobotLink
from ik_proto.robots import load_description
from sim_client.arms import ArmKinematics
from sim_client.paths import ScriptedPath
from sim_client.robot import CONTROL_PERIOD

MAX_BACKLOG = 0.5
"""How far behind schedule the loop tries to catch up [s]."""

HEARTBEAT_S = 0.1
"""How old the last line of the diary may become [s]."""

REGRIP_S = 0.3
GIVE_BACK_S = 5.0
"""How long the robot may take to take its arms back [s]."""


class Diary:
    """Writes down what changes, and now and then that nothing has."""

    def __init__(self, path: Path) -> None:
        """Append to a file."""
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        self._entry: dict[str, object] = {"grip": False, "following": False, "states": []}
        self._written = -HEARTBEAT_S

    def note(self, **values: object) -> None:
        """Take values over; write all of them where one is new, or the last line is old."""
        now, before = time.monotonic(), self._entry
        self._entry = before | values
        if self._entry != before or now - self._written >= HEARTBEAT_S:
            self._written = now
            # One unbuffered write a line: a SIGKILL loses none and tears none.
            os.write(self._file, json.dumps({"t": now, "pid": os.getpid(), **self._entry}).encode() + b"\n")


class Operator:
    """Grips when the robot is ready, lets go when an arm was disarmed, and grips again after a moment.

    The hands move along their path whatever the grips do: what is followed is where they are.
    """

    def __init__(self, path: ScriptedPath, diary: Diary) -> None:
        """Prepare; the path begins with the first look."""
        self._path = path
        self._diary = diary
        self._begin: float | None = None
        self._open_since: float | None = None
        self.grips = False

    def hands(self, now: float) -> Hands:
        """What the hands do now."""
        self._begin = now if self._begin is None else self._begin
        left, right = self._path.poses(now - self._begin)
        return Hands(HandSample(left, self.grips, now), HandSample(right, self.grips, now))

    def decide(self, report: TickReport) -> None:
        """Decide what the grips do in the next tick; it is written down before it happens."""
        self._open_since = report.time if self._open_since is None else self._open_since
        ready = report.measured is not None and report.measured.ready
        if self.grips and any(step.state is ArmState.DISARMED for step in report.arms):
            self.grips, self._open_since = False, report.time
        elif not self.grips and ready and report.time - self._open_since >= REGRIP_S:
            self.grips = True
        self._diary.note(grip=self.grips)


def arm() -> ArmEngagement:
    """An arm that goes where the hand is, with the gate of a real tracker."""
    return ArmEngagement.absolute()


def run(service_url: str, robot_url: str, diary: Diary) -> None:
    """Operate until SIGTERM."""
    arms = ArmKinematics(load_description("g1"))
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    with IKClient(service_url, timeout=0.01, connect=False) as ik, RobotLink(robot_url) as robot:
        operator = Operator(ScriptedPath("circles", arms), diary)
        limiter = JointLimiter(len(arms.joint_names), CONTROL_PERIOD, lower=arms.lower, upper=arms.upper)
        loop = TeleopLoop(ik, operator, robot, limiter, arms=(arm(), arm()), feed_forward=True)
        due = time.monotonic()
        while not ended:
            now = time.monotonic()
            due = now if now - due > MAX_BACKLOG else due
            time.sleep(max(0.0, due - now))
            due += CONTROL_PERIOD
            report = loop.tick()
            operator.decide(report)
            following = report.measured is not None and report.measured.following
            diary.note(following=following, states=[step.state for step in report.arms], reason=report.reason)
        loop.release()
        robot.release(GIVE_BACK_S)
        diary.note(grip=False, following=False, reason="given back")


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2], Diary(Path(sys.argv[3])))
