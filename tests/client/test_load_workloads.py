"""The workloads: what they ask for, and that a seed decides all of it."""

import numpy as np
import pytest
from fake_service import LOWER, SHOULDERS, UPPER, FakeService
from hypothesis import given
from hypothesis import strategies as st

from ik_client.load.workloads import MOST_FRAMES, Workload, make_workload
from ik_proto import FkRequest, InfoRequest


class Oracle:
    """The stand-in's answers without a wire."""

    def __init__(self) -> None:
        self.service = FakeService()
        self.asked: list[np.ndarray] = []

    def info(self):
        return self.service.reply(InfoRequest())

    def fk(self, q):
        self.asked.append(q)
        return self.service.reply(FkRequest(q))


def make(name, seed=0, rate=50.0, frames=300, oracle=None):
    return make_workload(name, oracle or Oracle(), seed=seed, rate=rate, frames=frames)


@pytest.mark.parametrize("name", ["tracking", "random", "unreachable"])
def test_the_seed_decides(name):
    one, same, other = make(name, 1), make(name, 1), make(name, 2)
    for field in ("left", "right", "q"):
        np.testing.assert_array_equal(getattr(one, field), getattr(same, field))
        assert not np.array_equal(getattr(one, field), getattr(other, field))


def test_tracking_is_smooth_within_four_fifths_of_the_limits_and_reachable():
    oracle = Oracle()
    workload = make("tracking", oracle=oracle)
    assert workload.chained
    middle, half = 0.5 * (UPPER + LOWER), 0.5 * (UPPER - LOWER)
    assert (np.abs(workload.q - middle) <= 0.8 * half).all()
    # Amplitudes add up to 0.8 of half the range, and no sinusoid is faster than 0.2 Hz.
    assert (np.abs(np.diff(workload.q, axis=0)) <= 2.0 * np.pi * 0.2 * 0.8 * half / 50.0).all()
    np.testing.assert_array_equal(oracle.asked, workload.q)
    np.testing.assert_array_equal(workload.left[:, :3, 3], workload.q[:, :3])
    np.testing.assert_array_equal(workload.right[:, :3, 3], workload.q[:, 7:10])


def test_tracking_at_twice_the_rate_is_the_same_path_in_smaller_steps():
    slow, fast = make("tracking", rate=50.0), make("tracking", rate=100.0)
    np.testing.assert_allclose(fast.q[::2], slow.q[:150], atol=1e-12)


def test_random_starts_and_targets_are_unrelated_and_within_the_limits():
    oracle = Oracle()
    workload = make("random", oracle=oracle)
    assert not workload.chained
    for q in (workload.q, np.array(oracle.asked)):
        assert (np.abs(q) <= 0.95 * UPPER).all()
        assert np.abs(q).max() > 0.9 * 0.95 * UPPER[0]
    assert np.abs(np.corrcoef(workload.q[:, 0], np.array(oracle.asked)[:, 0])[0, 1]) < 0.3


def test_unreachable_targets_are_out_of_reach_in_the_directions_of_tracking():
    path, far = make("tracking"), make("unreachable")
    for side, shoulder in zip(("left", "right"), SHOULDERS, strict=True):
        arm = getattr(far, side)[:, :3, 3] - shoulder
        np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 1.3 * 0.5, rtol=1e-9)
        before = getattr(path, side)[:, :3, 3] - shoulder
        cosine = np.sum(arm * before, axis=1) / np.linalg.norm(before, axis=1) / 0.65
        np.testing.assert_allclose(cosine, 1.0, rtol=1e-9)
        np.testing.assert_array_equal(getattr(far, side)[:, :3, :3], getattr(path, side)[:, :3, :3])


def test_a_long_run_asks_for_a_bounded_number_of_targets():
    assert len(make("random", frames=10**9).q) == MOST_FRAMES


@given(st.integers(1, 50), st.integers(0, 10_000))
def test_frames_go_back_and_forth_one_at_a_time(frames, k):
    T = np.tile(np.eye(4), (frames, 1, 1))
    workload = Workload("test", T, T, np.zeros((frames, 14)), chained=True)
    here, there = workload.frame(k), workload.frame(k + 1)
    assert 0 <= here < frames
    assert abs(here - there) == (1 if frames > 1 else 0)
    assert [workload.frame(i) for i in range(frames)] == list(range(frames))
