"""What goes wrong before the camera, in it and behind it: the arms hold. Service and robot are real processes."""

import itertools
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from acted import ASIDE, BOTH_ACTIVE, LIMIT, Operator, Running, swaying
from mirror_rig import Watcher
from painted_person import DOWN, FORWARD, LEFT, limbs
from processes import running

from camera_client import session
from camera_client.approach import Stage
from camera_client.cockpit import Cockpit
from ik_client import IKClient
from ik_client.joint_limiter import interval
from ik_client.state_machine import ArmState
from ik_client.tick_report import TickReport
from ik_client.types import Command
from ik_proto.robots import load_description

HOLDING = {ArmState.HOLD, ArmState.DISARMED, ArmState.ALIGNING}
ATTEMPTS = 8
BRAKED_S = 0.4
"""Time to come to rest from any motion, and to spare [s]."""
AT_ONCE = {"start": "operator", "start_speed": 3.0}
"""The slow beginning has tests of its own."""


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Iterator[str]:
    """Address of a simulated robot."""
    command = ("sim_client", "--listen", "127.0.0.1:0", "--headless", "--eyes-to", "off")
    with running(*command, log=tmp_path_factory.mktemp("robot") / "log") as (_, ready):
        yield f"tcp://{ready['listen']}"


def stands_still(watcher: Watcher, seconds: float = 0.3) -> bool:
    """Whether the robot's set-point does not move, once it has had the time to brake."""
    time.sleep(BRAKED_S)
    begin = time.monotonic()
    time.sleep(seconds)
    q = np.array([one.q_set for one in watcher.between(begin, time.monotonic())])
    assert len(q) > 2
    return float(np.abs(q - q[0]).max()) <= 1e-9


WIDE = limbs((DOWN + 0.7 * LEFT, FORWARD + 0.5 * LEFT), (DOWN - 0.7 * LEFT, FORWARD - 0.5 * LEFT))
"""Arms away from home."""


def until_still(watcher: Watcher) -> bool:
    """Wait until the robot's set-point hardly moves any more."""
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        now = time.monotonic()
        q = np.array([one.q_set for one in watcher.between(now - 0.5, now)])
        if len(q) > 5 and np.abs(q - q[-1]).max() < 0.02:
            return True
        time.sleep(0.05)
    return False


def follow(run: Running, operator: Operator) -> None:
    """Let go, press, and wait until both arms follow; once more where a busy machine lost them on the way."""
    for _ in range(ATTEMPTS):
        operator.held = False
        run.until(lambda shown: shown.switch is False and not any(state is ArmState.ACTIVE for state in shown.states))
        run.until(lambda shown: shown.operator == "in view" and not shown.trouble)
        operator.held = True
        if run.soon(lambda shown: shown.states == BOTH_ACTIVE):
            return
    pytest.fail(f"the arms never follow: {run.said}")


def follows(run: Running, operator: Operator, watcher: Watcher) -> bool:
    """Whether the robot moves with the operator after a press."""
    for _ in range(ATTEMPTS):
        follow(run, operator)
        if not stands_still(watcher):
            return True
    return False


def held(run: Running) -> None:
    """Wait until no arm follows."""
    run.until(lambda shown: set(shown.states) <= HOLDING)


def test_whatever_happens_to_the_operator_the_arms_hold_and_go_on(monkeypatch, robot, service_process):
    """Hazard: passer-by."""
    operator = Operator()
    with Watcher(robot) as watcher, Running(monkeypatch, operator, service_process.tcp_url, robot, **AT_ONCE) as run:
        # The switch is not held: arms may do what they like.
        run.until(lambda shown: shown.look is not None and shown.look.estimate is not None)
        assert stands_still(watcher)
        assert run.until(lambda shown: shown.switch is False).states == (ArmState.DISARMED, ArmState.DISARMED)
        assert follows(run, operator, watcher)

        # Nobody in view: hold, and disarmed in the end; the same press does not count any more.
        operator.body = False
        held(run)
        assert stands_still(watcher)
        run.until(lambda shown: shown.trouble == "nobody faces the camera")
        operator.body = True
        run.until(lambda shown: shown.operator == "in view")
        assert stands_still(watcher)
        follow(run, operator)

        # A passer-by takes the pose model's eye.
        operator.place = ASIDE
        held(run)
        shown = run.until(lambda shown: shown.trouble.startswith("somebody else"))
        assert "somebody else" in shown.operator
        assert stands_still(watcher)
        operator.place = Operator().place
        follow(run, operator)

        # The camera stops.
        operator.frames = False
        held(run)
        assert run.until(lambda shown: shown.trouble.startswith("no frame for")).states != BOTH_ACTIVE
        assert stands_still(watcher)
        operator.frames = True
        follow(run, operator)

        # The pose model fails.
        operator.broken = True
        held(run)
        assert stands_still(watcher)
        operator.broken = False
        follow(run, operator)

        # One arm out of view: the other one goes on.
        operator.hidden = (0,)
        run.until(lambda shown: shown.states[0] in HOLDING and shown.states[1] is ArmState.ACTIVE)
        assert not stands_still(watcher)
        assert "the left arm is out of view" in run.until(lambda shown: shown.states[0] in HOLDING).arms[0]
        operator.hidden = ()
        follow(run, operator)

        # Let go.
        operator.held = False
        held(run)
        assert stands_still(watcher)
        # Nobody can tell.
        follow(run, operator)
        operator.held = None
        held(run)
        assert stands_still(watcher)
    assert run.error is None
    assert "camera: RuntimeError: the model is broken" in run.said
    assert "camera: frames come again" in run.said
    assert run.report is not None
    assert run.report.step_at_rest <= 1e-9


def test_a_press_while_nobody_is_there_is_void(monkeypatch, robot, service_process):
    operator = Operator()
    with Watcher(robot) as watcher, Running(monkeypatch, operator, service_process.tcp_url, robot, **AT_ONCE) as run:
        run.until(lambda shown: shown.look is not None and shown.look.estimate is not None)
        operator.body = False
        run.until(lambda shown: shown.trouble == "nobody faces the camera")
        operator.held = True
        run.until(lambda shown: shown.switch)
        operator.body = True
        run.until(lambda shown: shown.operator == "in view")
        assert stands_still(watcher)
        follow(run, operator)


def test_when_the_source_ends_the_arms_hold_and_so_does_the_run(monkeypatch, robot, service_process):
    operator = Operator()
    with Watcher(robot) as watcher, Running(monkeypatch, operator, service_process.tcp_url, robot, **AT_ONCE) as run:
        follow(run, operator)
        operator.fault, operator.finished = "the cable is out", True
        run.ended()
        assert run.error is None
        assert stands_still(watcher)
    assert "the source has ended: the cable is out" in run.said
    assert "the robot holds its arms where they are" in run.said


def test_a_service_that_dies_holds_the_arms(monkeypatch, robot, start_service):
    service = start_service()
    operator = Operator()
    with Watcher(robot) as watcher, Running(monkeypatch, operator, service.tcp_url, robot, **AT_ONCE) as run:
        follow(run, operator)
        service.stop(signal.SIGKILL)
        held(run)
        assert stands_still(watcher)
        run.until(lambda shown: shown.states == (ArmState.DISARMED, ArmState.DISARMED))
    assert run.error is None
    assert any("service" in line.lower() for line in run.said if "arm:" in line)


def test_the_next_operator_begins_with_a_press_of_their_own(monkeypatch, robot, service_process):
    """Released by a key: the arms are disarmed, and whoever is seen next is the operator. Hazard: passer-by."""
    operator = Operator()
    pressed: list[bool] = []
    attend = Cockpit.attend
    monkeypatch.setattr(Cockpit, "attend", lambda self, now: attend(self, now) or (bool(pressed) and pressed.pop()))
    with Watcher(robot) as watcher, Running(monkeypatch, operator, service_process.tcp_url, robot, **AT_ONCE) as run:
        follow(run, operator)
        operator.place = ASIDE
        run.until(lambda shown: shown.trouble.startswith("somebody else"))
        pressed.append(True)
        run.until(lambda shown: shown.operator == "in view")
        assert run.until(lambda shown: shown.states != BOTH_ACTIVE).switch is True
        assert stands_still(watcher)
        assert follows(run, operator, watcher)
    assert "whoever is seen next is the operator" in run.said


def test_arms_go_home_first_then_come_and_all_of_it_slowly(monkeypatch, robot, service_process):
    """From wherever they were left: no joint is faster than half a radian a second until it follows. Hazard: homing."""
    operator = Operator()
    with Watcher(robot) as watcher, Running(monkeypatch, operator, service_process.tcp_url, robot, **AT_ONCE) as run:
        assert follows(run, operator, watcher)
        # Who stops in mid-swing leaves the torque of another posture behind, and the arm beside its command.
        operator.limbs = lambda _t: WIDE
        assert until_still(watcher)
    operator.limbs = swaying
    commands: list[Command] = []

    class Loop(session.TeleopLoop):
        followed = False

        def tick(self) -> TickReport:
            tracker: Any = self._source
            # At the end of the run the arms brake from any speed, and are to come slowly again: that is not looked at.
            self.followed |= any(approach.stage is Stage.FOLLOWING for approach in tracker.approaches)
            done = super().tick()
            if not self.followed:
                commands.append(done.command)
            return done

    monkeypatch.setattr(session, "TeleopLoop", Loop)
    with (
        Watcher(robot) as watcher,
        Running(monkeypatch, operator, service_process.tcp_url, robot) as run,
        IKClient(service_process.tcp_url, timeout=5.0) as ik,
    ):
        follow(run, operator)
        run.until(lambda shown: "going home" in " ".join(shown.arms))
        run.until(lambda shown: not any("going home" in words for words in shown.arms))
        coming = time.monotonic()
        description = load_description("g1")
        home = ik.fk(np.array([description.joint(name).home for name in description.arm_joints]))
        seen = watcher.between(coming - 0.5, coming)
        ways = [ik.fk(np.asarray(one.q_set)).left_wrist[:3, 3] - home.left_wrist[:3, 3] for one in seen]
        assert min(np.linalg.norm(way) for way in ways) < 0.02
        run.until(lambda shown: shown.arms == ("following", "following"))
    speeds = [np.abs(b.q - a.q).max() / interval(b.time - a.time, 0.02) for a, b in itertools.pairwise(commands)]
    assert 0.3 < max(speeds) < 0.5 * 1.001
