"""The parts around the loop: the camera's thread, the loop's thread, stages, what is shown and drawn."""

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from acted import ASIDE, Operator
from looks import FRAME, estimate, look
from rich.console import Console

from camera_client.approach import Approach
from camera_client.board import Board, Shown
from camera_client.chain import Chain
from camera_client.loop_thread import REST_TICKS, LoopThread
from camera_client.perception import Perception
from camera_client.preview import PICTURE, SIZE, Preview
from camera_client.run_report import RunReport
from camera_client.scaling import G1_ARMS
from camera_client.stages import STAGES, Stages
from camera_client.terminal import table
from camera_client.tracker import CameraTracker, Look
from ik_client.gate import Verdict
from ik_client.pacer import Pacer
from ik_client.state_machine import ArmState


class Clock:
    """A millisecond passes with every look at it."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        self.now += 0.001
        return self.now


def perception(operator: Operator) -> tuple[Perception, CameraTracker, Stages]:
    tracker, stages = CameraTracker(G1_ARMS), Stages()
    return Perception(operator, operator, Chain(), tracker, stages), tracker, stages


def latest(tracker: CameraTracker) -> Look:
    assert tracker.latest is not None
    return tracker.latest


def step(seeing: Perception, frames: int = 1) -> None:
    before = seeing.frames
    while seeing.frames < before + frames:
        seeing.step()


def test_a_frame_becomes_a_look_with_its_times_and_its_switch():
    operator = Operator()
    operator.held = True
    seeing, tracker, stages = perception(operator)
    step(seeing)
    found = tracker.latest
    assert found is not None
    assert found.estimate is not None
    assert found.captured == found.frame.t_capture == seeing.first
    assert found.captured <= found.received <= found.ready
    assert found.held is True
    assert (seeing.frames, seeing.bodies, seeing.fault) == (1, 1, "")
    assert set(stages.document()) == {"camera", "landmarks", "lift", "filter"}


def test_a_frame_without_a_body_lifts_nothing():
    operator = Operator()
    operator.body = False
    seeing, tracker, stages = perception(operator)
    step(seeing)
    assert tracker.latest is not None
    assert tracker.latest.estimate is None
    assert set(stages.document()) == {"camera", "landmarks"}


def test_a_model_that_fails_costs_its_frame_and_says_why():
    operator = Operator()
    seeing, tracker, _ = perception(operator)
    step(seeing)
    before, operator.broken = tracker.latest, True
    step(seeing)
    assert tracker.latest is before
    assert seeing.fault == "RuntimeError: the model is broken"
    operator.broken = False
    step(seeing)
    assert tracker.latest is not before
    assert seeing.fault == ""


def test_a_release_lets_somebody_else_in():
    operator = Operator()
    seeing, tracker, _ = perception(operator)
    step(seeing)
    operator.place = ASIDE
    step(seeing, 20)
    found = latest(tracker)
    assert tracker.trouble(found.captured) == "somebody else is before the camera"
    assert found.refused > 0
    seeing.release_operator()
    step(seeing, 30)
    found = latest(tracker)
    assert found.estimate is not None
    assert found.estimate.tracked.all()
    assert found.refused == 0


def test_the_thread_ends_with_the_source_and_when_it_is_told_to():
    operator = Operator()
    seeing, _, _ = perception(operator)
    assert not seeing.finished
    seeing.close()  # before it began
    seeing.start()
    operator.finished = True
    seeing._thread.join(10.0)
    assert seeing.finished
    again, _, _ = perception(Operator())
    again.start()
    again.close()
    assert again.finished


def test_stages_count_a_frame_once_and_to_the_command():
    clock = Clock()
    stages = Stages(clock)
    seen = look(100.0, received=100.03, ready=100.055)
    stages.seen(seen, 100.05, 100.053)
    tick: Any = SimpleNamespace(time=100.06, round_trip=0.002)
    clock.now = 100.063
    for _ in range(3):
        stages.observe(tick, seen)
    stages.observe(tick, None)
    found = {name: row["max"] for name, row in stages.document().items()}
    wanted = {"camera": 30, "landmarks": 20, "lift": 3, "filter": 2, "wait": 5, "ik": 2, "command": 34, "whole": 64}
    assert found == pytest.approx(wanted)
    assert list(found) == list(STAGES)
    assert stages.document()["command"]["n"] == 1
    assert stages.document()["ik"]["n"] == 4


def loop_thread(tick, stop=lambda: None, finished=lambda: False) -> LoopThread:
    def end(tick) -> None:
        stop()
        tick()

    return LoopThread(tick, end, Pacer(1e-3), lambda _pacer: None, finished)


def test_the_loop_ticks_until_it_is_told_to_end_and_disarms_before_the_last_tick():
    done: list[str] = []
    ticking = loop_thread(lambda: done.append("tick") or ["a line"], lambda: done.append("stop"))
    ticking.close()  # before it began
    ticking = loop_thread(lambda: done.append("tick") or ["a line"], lambda: done.append("stop"))
    ticking.start()
    while "tick" not in done:
        pass
    ticking.close()
    assert not ticking.alive
    assert done[-2:] == ["stop", "tick"]
    assert done.count("stop") == 1
    assert len(ticking.lines) == done.count("tick")


def test_the_loop_rests_after_the_last_frame():
    ticks: list[int] = []
    ticking = loop_thread(lambda: ticks.append(1) or [], finished=lambda: True)
    ticking.start()
    ticking._thread.join(10.0)
    assert len(ticks) == REST_TICKS + 1
    ticking.close()


def test_what_ends_the_loop_is_raised_where_it_is_closed():
    def tick() -> list[str]:
        raise OSError("the robot is gone")

    ticking = loop_thread(tick)
    ticking.start()
    with pytest.raises(OSError, match="the robot is gone"):
        ticking.close()
    ticking.close()  # once is enough


class Ticks:
    """A board with ticks of our own."""

    def __init__(self, *, mirror: bool = False) -> None:
        self.tracker = CameraTracker(G1_ARMS, lambda _now: True, mirror=mirror)
        approaches = Approach(0, 0.2, home_first=True), Approach(1, 0.2, home_first=False)
        self.board = Board(self.tracker, Stages(), approaches)

    def look(self, left: ArmState, right: ArmState, verdict: Verdict = Verdict.OK, **measured: Any) -> Shown:
        steps = tuple(
            SimpleNamespace(state=state, reason="" if state is ArmState.ACTIVE else "because", verdict=verdict)
            for state in (left, right)
        )
        state = SimpleNamespace(ready=True, note="") if not measured else SimpleNamespace(**measured)
        tick: Any = SimpleNamespace(arms=steps, measured=state, reason="", time=1.0)
        self.board.observe(tick)
        return self.board.look(1.0)


def test_what_is_shown_says_what_each_arm_does_and_why_it_holds():
    ticks = Ticks()
    before = ticks.board.look(1.0)
    assert before.arms == ("not started", "not started")
    assert before.operator == "nobody yet"
    assert not ticks.board.robot_ready
    ticks.tracker.feed(look(1.0))
    shown = ticks.look(ArmState.ACTIVE, ArmState.ACTIVE)
    assert shown.arms == ("going home, slowly", "coming to your posture, slowly: hold still")
    assert (shown.switch, shown.operator, shown.trouble) == (True, "in view", "")
    shown = ticks.look(ArmState.HOLD, ArmState.DISARMED)
    assert shown.arms == ("hold: because", "disarmed: because; let go and press to begin")
    assert ticks.look(ArmState.HOLD, ArmState.HOLD, Verdict.STALE).arms == ("hold: because", "hold: because")
    assert ticks.board.look(2.0).arms[0] == "hold: no frame for 1.0 s"


@pytest.mark.parametrize(("mirror", "side"), [(False, 0), (True, 1)])
def test_an_arm_out_of_view_is_named_as_the_operators(mirror, side):
    ticks = Ticks(mirror=mirror)
    ticks.tracker.feed(look(1.0, estimate(1.0, tracked=np.array([False, True]), note="the left arm is out of view")))
    shown = ticks.look(ArmState.HOLD, ArmState.HOLD, Verdict.UNTRACKED)
    assert shown.arms[side] == "hold: the left arm is out of view"
    assert shown.arms[1 - side] == "hold: because"


def test_the_robot_comes_first_among_what_is_wrong():
    ticks = Ticks()
    assert ticks.look(ArmState.DISARMED, ArmState.DISARMED, ready=False, note="").trouble == "the robot: not ready"
    assert ticks.look(ArmState.DISARMED, ArmState.DISARMED).trouble == "no frame yet"
    assert ticks.board.robot_ready


def shown(**changes: Any) -> Shown:
    base = Ticks()
    base.tracker.feed(look(1.0))
    out = base.look(ArmState.ACTIVE, ArmState.HOLD)
    fields = {name: getattr(out, name) for name in Shown.__slots__} | changes
    return Shown(**fields)


def test_the_preview_shows_the_picture_as_in_a_mirror_and_skeletons_by_confidence():
    operator = Operator()
    seeing, tracker, _ = perception(operator)
    step(seeing, 3)
    assert tracker.latest is not None
    colour = np.zeros((*PICTURE[::-1], 3), np.uint8)
    colour[:, :50] = (0, 0, 255)
    preview = Preview()
    pictures = {}
    for name, trust in (("sure", 1.0), ("unsure", 0.0)):
        arms = estimate(1.0, confidence=np.full(2, trust), elbow_confidence=np.full(2, trust))
        seen = look(1.0, arms, landmarks=tracker.latest.landmarks)
        object.__setattr__(seen.frame, "colour", colour)
        pictures[name] = preview.draw(shown(look=seen), "a hint").copy()
    picture = pictures["sure"]
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    assert (picture[5, PICTURE[0] - 5] == (0, 0, 255)).all()
    assert (picture[5, 5] == 0).all()
    # Green arms, red arms.
    green = {name: int(((p[..., 1] > 150) & (p[..., 0] < 120))[:, : PICTURE[0]].sum()) for name, p in pictures.items()}
    assert green["sure"] > 1.3 * green["unsure"]
    panel = picture[:, PICTURE[0] :]
    assert (panel.max(axis=-1) > 150).sum() > 500  # words


@pytest.mark.parametrize("size", [(360, 640), (480, 640), (720, 1280), (640, 360)])
def test_a_picture_of_any_shape_is_fitted_in(size):
    seen = look(1.0)
    object.__setattr__(seen, "frame", FRAME.__class__(1.0, None, FRAME.intrinsics, np.full((*size, 3), 200, np.uint8)))
    picture = Preview().draw(shown(look=seen))
    assert (picture[:, : PICTURE[0]] == 200).all(axis=-1).sum() > 0.3 * PICTURE[0] * PICTURE[1]


def test_without_a_picture_the_preview_says_so():
    assert Preview().draw(shown(look=None, trouble="no frame yet")).any()


def test_a_terminal_has_the_same_in_a_table():
    console = Console(width=100, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(table(shown(trouble="something is wrong", latency_ms={"camera": 1.25, "ik": None})))
    console.file.close()
    words = console.export_text()
    for part in ("switch", "held", "left arm", "going home", "hold: because", "camera 1.2", "something is wrong"):
        assert part in words
    assert "ik" not in words


def test_the_report_tells_of_the_camera(tmp_path):
    operator = Operator()
    seeing, tracker, stages = perception(operator)
    step(seeing, 2)
    report = RunReport(stages, tracker, seeing, {"source": "an operator"})
    report.write(tmp_path / "report.json")
    document = report.document()
    assert document["source"] == "an operator"
    assert document["frames"] == {"seen": 2, "with_a_body": 2, "first": seeing.first, "of_somebody_else": 0}
    assert document["fault"] == ""
    assert (tmp_path / "report.json").read_text().endswith("}\n")
    assert threading.active_count() < 50
