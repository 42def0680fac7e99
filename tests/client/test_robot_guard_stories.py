"""The guard over whole stories: its bounds and its rules hold whatever happens, and in whatever order."""

from typing import Any

import numpy as np
import pytest
from guard_bench import LOWER, PERIOD, TICKS_OF_THE_RAMP, UPPER, Bench, N
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_client.joint_limiter import MotionLimits
from ik_client.robot_end import EndState

pytest.importorskip("ruckig")

UNDER_WEIGHT = set(EndState) - {EndState.RELEASED}

EVENTS = ["go"] * 6 + ["jump", "silence", "restart", "disengage", "other", "old", "nonsense", "release"]
STORIES = st.lists(
    st.tuples(
        st.sampled_from(EVENTS),
        st.integers(1, 30),
        st.tuples(*[st.floats(-2.5, 2.5)] * N),
    ),
    min_size=1,
    max_size=10,
)


def play(bench: Bench, story) -> None:
    """A loop, its operator, its rivals and its network, on any day."""
    boot, engaged = 0, False
    for what, ticks, q in story:
        goal = np.array(q)
        match what:
            case "silence":
                bench.tick(ticks)
                continue
            case "restart":
                boot += 1
            case "disengage" | "release":
                engaged = False
        for k in range(ticks):
            named: dict[str, Any] = {"boot_id": f"boot {boot}", "engaged": engaged}
            match what:
                case "other":
                    bench.send(goal, session="b", **named)
                case "old":
                    bench.send(goal, seq=1, **named)
                case "nonsense":
                    bench.send(np.where(np.arange(N) == k % N, np.nan, goal), **named)
                case "release":
                    bench.send(release=True, **named)
                case "jump":
                    bench.send(goal, **named)
                case _:
                    way = goal - bench.q_set
                    bench.send(bench.q_set + way * min(1.0, 0.02 / max(np.abs(way).max(), 1e-9)), **named)
            bench.tick()
            engaged = engaged or (what == "go" and bench.state is EndState.READY)


@given(STORIES)
@settings(max_examples=30)
def test_bounds_and_rules_hold_for_every_story(story):
    """Hazard rows "velocity / acceleration / jerk", "joint limits" and "first frame", over the whole guard."""
    bench = Bench()
    bench.follow()
    play(bench, [("go", 1, (0.0,) * N), *story])
    limits = MotionLimits()
    q = np.array([s.q for s in bench.setpoints])
    states = [s.state for s in bench.setpoints]
    v, weights = np.diff(q, axis=0) / PERIOD, [s.weight for s in bench.setpoints]
    assert np.isfinite(q).all()
    assert np.isfinite([s.tau for s in bench.setpoints]).all()
    assert ((q >= LOWER) & (q <= UPPER)).all()
    assert np.abs(np.diff(weights)).max() <= 1.0 / TICKS_OF_THE_RAMP + 1e-9
    for k in range(2, len(states)):
        if {states[k], states[k - 1], states[k - 2]} <= UNDER_WEIGHT and EndState.TAKING not in (
            states[k],
            states[k - 1],
        ):
            assert np.abs(v[k - 1]).max() <= limits.velocity * (1 + 1e-5)
            assert np.abs(v[k - 1] - v[k - 2]).max() / PERIOD <= limits.acceleration * (1 + 1e-5)
        if states[k] is EndState.TAKING and states[k - 1] is EndState.TAKING:
            np.testing.assert_array_equal(q[k], q[k - 1])
