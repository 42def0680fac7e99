"""The chain's rules on a person of painted patches: exact geometry, loss and return, strangers, time."""

import numpy as np
import pytest
from arm_metrics import angle_between
from painted_person import BENT, DOWN, FORWARD, FPS, HANGING, LEFT, ORIGIN, RAISED, SPREAD, body, limbs, look

from camera_client.calibration import TYPICAL
from camera_client.chain import Chain
from camera_client.estimate import ORIENTATION_FLOOR, ArmsEstimate

STRANGER = ORIGIN + np.array([0.6, 0.0, -0.9])


class Operator:
    """Feeds a chain frame after frame."""

    def __init__(self) -> None:
        self.chain = Chain(TYPICAL)
        self.frames = 0
        self.seen: list[ArmsEstimate] = []

    def show(self, frames: int, directions: np.ndarray, **kwargs) -> ArmsEstimate:
        for _ in range(frames):
            self.frames += 1
            estimate = self.chain.update(*look(self.frames / FPS, directions, **kwargs))
            assert estimate is not None
            self.seen.append(estimate)
        return self.seen[-1]

    def hide(self, frames: int) -> ArmsEstimate:
        frame, _ = look(0.0, HANGING)
        for _ in range(frames):
            self.frames += 1
            estimate = self.chain.update(type(frame)(self.frames / FPS, frame.depth, frame.intrinsics), None)
            assert estimate is not None
            self.seen.append(estimate)
        return self.seen[-1]

    def steps(self) -> tuple[float, float]:
        """Longest step of a wrist [m] and largest turn of one [degree] from a frame to the next."""
        p = np.array([e.joints[:, 2] for e in self.seen])
        R = np.array([e.R_pelvis_wrist for e in self.seen])
        return np.linalg.norm(np.diff(p, axis=0), axis=-1).max(), angle_between(R[1:], R[:-1]).max()


@pytest.mark.parametrize("directions", [HANGING, SPREAD, BENT, RAISED], ids=["hanging", "spread", "bent", "raised"])
def test_exact_pictures_give_exact_arms(directions):
    estimate = Operator().show(30, directions)
    assert estimate.tracked.all()
    assert estimate.note == ""
    assert np.linalg.norm(estimate.joints - body(directions)[:6].reshape(2, 3, 3), axis=-1).max() < 0.03
    assert np.degrees(np.arccos((estimate.limbs * directions).sum(axis=-1).clip(-1.0, 1.0))).max() < 8.0
    lengths = np.linalg.norm(np.diff(estimate.joints, axis=1), axis=-1)
    assert np.allclose(lengths, TYPICAL.lengths)
    assert np.abs(estimate.velocity).max() < 0.05
    assert (estimate.confidence > 0.9).all()


def test_orientation_counts_as_far_as_elbows_are_bent():
    straight, bent = Operator().show(30, SPREAD), Operator().show(30, BENT)
    assert np.allclose(bent.weights, 1.0, atol=0.1)
    assert (straight.weights[:, 0] == 1.0).all()
    assert (straight.weights[:, 1] < ORIENTATION_FLOOR + 0.1).all()


def test_nobody_is_nothing():
    chain = Chain()
    frame, landmarks = look(1.0, HANGING)
    assert chain.update(frame, None) is None
    landmarks.visibility[:] = 0.2
    assert chain.update(look(2.0, HANGING)[0], landmarks) is None
    assert chain.latest is None


def test_a_frame_that_is_not_newer_is_refused():
    chain = Chain()
    chain.update(*look(1.0, HANGING))
    for t in (1.0, 0.5, float("nan")):
        with pytest.raises(ValueError, match=r"came after one of 1\.0 s"):
            chain.update(*look(t, HANGING))


@pytest.mark.parametrize("seconds", [0.5, 2.0])
def test_a_hidden_arm_is_held_and_comes_back_without_a_jump(seconds):
    operator = Operator()
    operator.show(30, BENT)
    before = operator.seen[-1].joints[0].copy()
    lost = operator.show(round(seconds * FPS), BENT, hidden=(0,))
    assert lost.tracked.tolist() == [False, True]
    assert lost.note == "the left arm is out of view"
    assert np.allclose(lost.joints[0], before, atol=1e-9)
    assert (lost.velocity[0] == 0.0).all()
    assert lost.confidence[0] == 0.0
    assert lost.weights[0, 1] == 0.0
    # It moved behind the cover.
    there = np.array([RAISED[0], BENT[1]])
    assert operator.show(1, there).tracked.all()
    operator.show(45, there)
    step, turn = operator.steps()
    assert step < 0.08
    assert turn < 30.0
    assert np.linalg.norm(operator.seen[-1].joints[0] - body(there)[:3], axis=-1).max() < 0.03


def test_a_lost_body_is_held_and_comes_back_without_a_jump():
    operator = Operator()
    before = operator.show(30, BENT)
    lost = operator.hide(60)
    assert not lost.tracked.any()
    assert lost.note == "nobody faces the camera"
    assert np.allclose(lost.joints, before.joints)
    operator.show(60, RAISED, origin=ORIGIN + np.array([0.2, 0.0, -0.2]))
    step, turn = operator.steps()
    assert step < 0.08
    assert turn < 30.0
    there = body(RAISED)[:6].reshape(2, 3, 3)
    assert np.linalg.norm(operator.seen[-1].joints - there, axis=-1).max() < 0.03


def test_a_passer_by_does_not_take_over():
    operator = Operator()
    before = operator.show(30, BENT)
    held = operator.show(30, RAISED, origin=STRANGER)
    assert not held.tracked.any()
    assert held.note == "somebody else is before the camera"
    assert np.allclose(held.joints, before.joints)
    assert operator.show(1, BENT).tracked.all()
    # The lock is released by hand.
    operator.chain.lock.release()
    assert operator.show(15, BENT, origin=STRANGER).tracked.all()


def test_hips_may_be_out_of_view():
    estimate = Operator().show(30, BENT, hips=False)
    assert estimate.tracked.all()
    assert np.linalg.norm(estimate.joints - body(BENT)[:6].reshape(2, 3, 3), axis=-1).max() < 0.04


def test_an_arm_never_seen_hangs():
    estimate = Operator().show(10, BENT, hidden=(1,))
    assert estimate.tracked.tolist() == [True, False]
    assert (estimate.limbs[1] == (0.0, 0.0, -1.0)).all()
    assert np.isfinite(estimate.joints).all()


def test_without_depth_on_the_body_arms_are_held():
    operator = Operator()
    operator.show(30, BENT)
    frame, landmarks = look(2.0, BENT)
    assert frame.depth is not None
    frame.depth[:] = 0
    held = operator.chain.update(frame, landmarks)
    assert held is not None
    assert held.note == "no depth on the body"
    assert not held.tracked.any()


def test_lost_frames_are_longer_steps():
    """Every third frame of a swing is as good as every frame, but for what happens in between."""
    errors = []
    for every in (1, 3):
        chain, error = Chain(TYPICAL), []
        for k in range(0, 90, every):
            angle = 0.6 * np.sin(2.0 * np.pi * 0.4 * k / FPS)
            swung = limbs((DOWN + 0.3 * LEFT, FORWARD + angle * DOWN), (DOWN - 0.3 * LEFT, FORWARD))
            estimate = chain.update(*look(1.0 + k / FPS, swung))
            assert estimate is not None
            error.append(np.linalg.norm(estimate.joints[0, 2] - body(swung)[2]))
        errors.append(np.mean(error[10:]))
    assert max(errors) < 0.03
