"""Prediction: what it gains on a moving arm, and where it stops."""

import math
from dataclasses import replace

import numpy as np
import pytest
from painted_person import FORWARD, LEFT, body, limbs

from camera_client.estimate import ArmsEstimate
from camera_client.prediction import FARTHEST, FASTEST, STILL, TAU, predicted

DIRECTIONS = limbs((LEFT, FORWARD), (-LEFT, FORWARD))


def still(confidence: float = 1.0) -> ArmsEstimate:
    return ArmsEstimate(
        t_capture=5.0,
        tracked=np.array([True, True]),
        joints=body(DIRECTIONS)[:6].reshape(2, 3, 3),
        velocity=np.zeros((2, 3, 3)),
        limbs=DIRECTIONS,
        R_pelvis_wrist=np.tile(np.eye(3), (2, 1, 1)),
        confidence=np.full(2, confidence),
        bend=np.ones(2),
        elbow_confidence=np.ones(2),
        yaw=0.0,
    )


def moving(speed: float = 1.0, confidence: float = 1.0) -> ArmsEstimate:
    """Wrists that swing up about the elbows."""
    velocity = np.zeros((2, 3, 3))
    velocity[:, 2, 2] = speed
    return replace(still(confidence), velocity=velocity)


def test_what_stands_still_stays():
    assert np.allclose(predicted(still(), 5.1).joints, still().joints)
    assert predicted(moving(), 5.0).joints is not None
    # A frame from the future is not older than now.
    assert predicted(moving(), 4.0).joints[0, 2, 2] == still().joints[0, 2, 2]


def test_a_swing_goes_on_damped_and_limbs_keep_their_lengths():
    before, after = moving(), predicted(moving(), 5.1)
    lengths = np.linalg.norm(np.diff(before.joints, axis=1), axis=-1)
    assert np.allclose(np.linalg.norm(np.diff(after.joints, axis=1), axis=-1), lengths)
    angle = math.atan2(after.limbs[0, 1, 2], after.limbs[0, 1, 0])
    counts = 1.0 / (1.0 + STILL**2)  # at 1 m/s
    assert angle == pytest.approx(math.atan2(counts * TAU * (1.0 - math.exp(-0.1 / TAU)), lengths[0, 1]))
    # The wrist turns with its forearm, and not about it.
    assert np.allclose(after.R_pelvis_wrist[:, :, 0], after.limbs[:, 1])
    assert np.allclose(after.R_pelvis_wrist[:, :, 1], [0.0, 1.0, 0.0])


def test_what_hardly_moves_is_taken_to_stand_still():
    rises = [predicted(moving(speed), 5.1).joints[0, 2, 2] - still().joints[0, 2, 2] for speed in (0.03, STILL, 1.0)]
    horizon = TAU * (1.0 - math.exp(-0.1 / TAU))
    assert rises[0] < 0.05 * 0.03 * horizon
    assert rises[1] == pytest.approx(0.5 * STILL * horizon, rel=0.01)
    assert rises[2] > 0.94 * horizon


def test_nothing_is_predicted_beyond_the_farthest_age():
    assert np.allclose(predicted(moving(), 5.0 + FARTHEST).joints, predicted(moving(), 99.0).joints)


def test_a_speed_is_bounded():
    assert np.allclose(predicted(moving(FASTEST), 5.1).joints, predicted(moving(50.0), 5.1).joints)


def test_an_arm_that_is_held_or_poorly_seen_is_not_predicted():
    assert np.allclose(predicted(moving(confidence=0.2), 5.1).joints, still().joints)
    held = replace(moving(), tracked=np.array([True, False]))
    after = predicted(held, 5.1)
    assert np.allclose(after.joints[1], still().joints[1])
    assert after.joints[0, 2, 2] > still().joints[0, 2, 2] + 0.05


def test_it_beats_doing_nothing_on_a_wave():
    errors = {"predicted": [], "nothing": []}
    for t in np.arange(0.0, 2.0, 1.0 / 30.0):
        rate = 2.0 * math.pi * 0.8
        lift = 0.6 * math.sin(rate * t)
        # A small swing: the wrist's height and speed, exactly.
        now = still().joints[0, 2, 2] + 0.25 * 0.6 * math.sin(rate * (t + 0.1))
        there = still()
        there.joints[:, 2, 2] += 0.25 * lift
        there.velocity[:, 2, 2] = 0.25 * 0.6 * rate * math.cos(rate * t)
        errors["predicted"].append(predicted(there, 5.1).joints[0, 2, 2] - now)
        errors["nothing"].append(there.joints[0, 2, 2] - now)
    assert np.std(errors["predicted"]) < 0.7 * np.std(errors["nothing"])
