"""The judge of the chaos runs finds what it is there to find: made-up records with one thing wrong each."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults.audit import Audit, audit
from benchmarks.faults.plan import Fault, Kind, Victim, plan
from benchmarks.faults.trace import Diary, Done, RobotTrace

DT = 0.02
KILLED, GRIPS = 3.0, [1.0, 6.0]
KILL = Done(Fault(Victim.OPERATOR, Kind.KILL, 1.0), KILLED, 6.04)


def record() -> RobotTrace:
    """Taken, followed from a grip, killed at 3 s, held, followed from a second grip at 6 s, given back."""
    t = np.arange(0.0, 10.0, DT)
    state = np.full(len(t), "ready", dtype="U9")
    for begin, end, name in (
        (0.0, 0.5, "taking"),
        (1.04, 3.1, "following"),
        (3.1, 3.5, "holding"),
        (6.04, 8.0, "following"),
        (9.0, 9.98, "releasing"),
        (9.98, 10.1, "released"),
    ):
        state[(t > begin - 1e-9) & (t < end - 1e-9)] = name
    v = np.interp(t, [1.04, 1.2, 3.1, 3.26, 6.04, 6.2, 7.9, 8.0], [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0])
    q = np.cumsum(v * DT)[:, None] * np.array([1.0, -0.5])
    weight = np.interp(t, [0.0, 0.5, 9.0, 9.98], [0.0, 1.0, 1.0, 0.0])
    return RobotTrace(t, np.full(len(t), DT), state, weight, q, q - 0.01, np.gradient(q, DT, axis=0))


def judged(trace: RobotTrace, done: Done = KILL, grips: list[float] = GRIPS) -> Audit:
    return audit(trace, [done], grips)


def shifted(trace: RobotTrace, at: float, change: float) -> RobotTrace:
    """The record with its set-points somewhere else from a time on."""
    return replace(trace, q_set=trace.q_set + change * (trace.t >= at - 1e-9)[:, None])


def during(trace: RobotTrace, begin: float, end: float, state: str) -> RobotTrace:
    changed = trace.state.copy()
    changed[(trace.t > begin - 1e-9) & (trace.t < end - 1e-9)] = state
    return replace(trace, state=changed)


def test_a_good_run_is_good() -> None:
    found = judged(record())
    assert found.violations == []
    assert (found.engagements, found.disarming, found.recovered) == (2, 1, 1)
    assert found.velocity == pytest.approx(1.0)
    assert found.step == pytest.approx(DT)
    assert found.sag == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("trace", "complaint"),
    [
        (shifted(record(), 2.0, 0.07), "velocity bound exceeded"),
        (shifted(record(), 2.0, 0.01), "acceleration bound exceeded"),
        (shifted(record(), 4.5, 1e-6), "moved by 1e-06 rad while ready"),
        (shifted(record(), 8.5, 1e-6), "moved by 1e-06 rad while ready"),
        (shifted(during(record(), 4.0, 5.0, "following"), 4.5, 1e-6), "without a grip"),
        (during(record(), 4.0, 4.2, "following"), "followed without a grip"),
        (during(record(), 3.5, 6.04, "holding"), "followed from holding"),
        (during(record(), 3.5, 6.04, "released"), "followed from released"),
        (replace(record(), q=record().q_set - 0.03), "hangs 0.03 rad below"),
        (replace(record(), q=np.where(record().t[:, None] == record().t[7], np.nan, record().q)), "not finite"),
    ],
)
def test_what_is_wrong_is_found(trace: RobotTrace, complaint: str) -> None:
    assert any(complaint in line for line in judged(trace).violations), judged(trace).violations


def test_a_grip_before_the_fault_does_not_count() -> None:
    assert any("without a grip" in line for line in judged(record(), grips=[1.0]).violations)
    assert any("without a grip" in line for line in judged(record(), grips=[1.0, 2.9]).violations)


def test_a_grip_while_an_arm_holds_begins_the_state_that_it_ends() -> None:
    """Gripped anew the loop aligns anew, and the robot's end is ready again for a moment."""
    regripped = during(record(), 2.0, 2.04, "ready")
    assert judged(regripped, grips=[1.0, 1.96, 6.0]).violations == []
    assert any("without a grip" in line for line in judged(regripped, grips=[1.0, 1.8, 6.0]).violations)


def test_a_short_stop_may_be_gone_on_from_and_a_long_one_not() -> None:
    for lasts, wrong in ((0.3, False), (1.5, True)):
        stopped = Done(Fault(Victim.SERVICE, Kind.STOP, 0.5, lasts), 1.5, 3.0)
        violations = judged(record(), stopped).violations
        assert any(f"after stop service for {lasts:.2f} s" in line for line in violations) is wrong


def test_a_robot_that_stays_behind_is_a_violation() -> None:
    found = judged(record(), replace(KILL, recovered=float("nan")))
    assert found.recovered == 0
    assert any("did not follow again" in line for line in found.violations)


def test_the_plan_has_everything_and_is_the_same_every_time() -> None:
    faults = list(plan(12, seed=3))
    assert faults == list(plan(12, seed=3))
    assert faults != list(plan(12, seed=4))
    for half in (faults[:6], faults[6:]):
        assert {(fault.victim, fault.kind) for fault in half} == {(v, k) for v in Victim for k in Kind}
    assert all((fault.lasts > 0.0) == (fault.kind is Kind.STOP) for fault in faults)


def test_a_line_that_is_still_being_written_is_read_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "diary.jsonl"
    diary = Diary(path)
    diary.update()
    path.write_bytes(b'{"t": 1.0}\n{"t": ')
    diary.update()
    assert diary.entries == [{"t": 1.0}]
    with path.open("ab") as file:
        file.write(b"2.0}\n")
    diary.update()
    diary.update()
    assert diary.entries == [{"t": 1.0}, {"t": 2.0}]
