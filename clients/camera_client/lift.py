"""From pixels to points: one frame's measurement of the tracked joints, given where the last frames expect them.

    patch of depths ─> surface near the expected one ─> centre of the joint ─> depths that fit the limbs

A surface that is far from where it is expected is none of the operator's, and one out of the arms' reach is not an
arm's.
"""

import math
from dataclasses import dataclass

import numpy as np

from camera_client.arm_fit import ArmEvidence, fit_arms
from camera_client.calibration import Calibration
from camera_client.depth_patch import patch_depths
from camera_client.frame import RgbdFrame
from camera_client.kalman import JointFilter, Mask
from camera_client.landmarks import ARMS, HIPS, SHOULDERS, TRACKED, WRISTS, Landmarks
from camera_client.limb_map import DepthEvidence, fit_depths
from camera_client.monocular import MODEL_SIGMA, model_depths
from camera_client.surface import HAND, HAND_SHARE, OFFSETS, covered, hands_before, shoulder_shift, shoulders_seen
from camera_client.trunk_plane import trunk_turn
from camera_client.vectors import between, length, middle
from ik_proto import Array

ACROSS_SIGMA = 0.012
"""Standard deviation of a joint across its viewing ray [m]."""
DEPTH_SIGMA = 0.03
"""Standard deviation of a joint along it, after the limb lengths had their say [m]."""
GUESSED_SIGMA = 0.06
"""The same where its depth was not measured."""
TRUNK_SIGMA = 0.025
"""Standard deviation of a shoulder by the rest of the trunk [m]."""
PIXEL_SIGMA = np.array([0.012, 0.025, 0.015])
"""How far landmarks of shoulder, elbow and wrist are off, as a standard deviation, shape (3,) [m]."""

_LEAST_SURE = 0.2
_CONFIRMED = 0.12
"""How far what is seen of a joint may be from where it is placed [m]."""
_WINDOW = np.array([0.25, 0.90, 0.90, 0.25, 0.90, 0.90, 0.35, 0.35])
"""How far from where it is expected the surface before a joint may be, shape (8,) [m]."""
_REACH = (-0.95, 0.50)
"""Where arms are along the optical axis, from the torso [m]."""
_FIRST_SIGMA = 0.5
"""Standard deviation of a depth before the first frame [m]."""
_SLACK = 0.02
"""What the last frames expect is never better than this [m]."""
_TRUNK = np.concatenate([SHOULDERS, HIPS])
_TRUNK_SIGMAS = np.full(2, TRUNK_SIGMA)
_NOWHERE = np.full((2, 3), math.nan)
"""The shoulders of a trunk that does not tell."""


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """What the camera sees at the joints of a body.

    Attributes:
        seen: Which joints are in the picture, shape (8,).
        rays: Viewing rays through the joints with z = 1, shape (8, 3); without meaning where not seen.
        depth: Of the joints' centres, shape (8,) [m]; NaN where not measured.
        sigma: Their standard deviations, shape (8,) [m].
        sure: How far the shoulders are seen, 0 to 1, shape (2,).
        front: How far the front of the trunk is turned to the left [rad], see `trunk_plane`; NaN where not seen.
        along: Standard deviations of the depths after the limb lengths had their say, shape (8,) [m].
        guessed: Whether the depths are the pose model's.
        place: Between the shoulders, at the depth of the body, optical frame, shape (3,) [m].
    """

    seen: Mask
    rays: Array
    depth: Array
    sigma: Array
    sure: Array
    front: float
    along: Array
    place: Array
    guessed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Lifted:
    """The joints of a frame.

    Attributes:
        positions: Optical frame, shape (8, 3) [m].
        sigma: Their standard deviations along the axes, shape (8, 3) [m].
        measured: Which of them are measured, shape (8,).
        confirmed: Which arms the camera sees where they are placed, by elbow or wrist, with nothing before either,
            shape (2,). A pose model shows an arm behind a cover as surely as one that is seen; only depth tells.
    """

    positions: Array
    sigma: Array
    measured: Mask
    confirmed: Mask


def surfaces(frame: RgbdFrame, landmarks: Landmarks, joints: JointFilter, calibration: Calibration) -> Surfaces | None:
    """Measure the depths at the joints of a credible body.

    Args:
        frame: What the camera saw.
        landmarks: What the pose model found in it.
        joints: Where the last frames expect the joints.
        calibration: The operator.

    Returns:
        The measurement; None where the camera measures no depth on the trunk, or measures none at all and the model
        has no guess either.
    """
    seen = landmarks.seen(*frame.size)
    if frame.depth is None:
        return _guessed(frame, landmarks, seen, calibration)
    pixels = np.where(seen[:, None], landmarks.pixels[TRACKED], np.nan)
    known = joints.known
    position = joints.position
    if not known[SHOULDERS].all():
        body = patch_depths(frame.depth, pixels[_TRUNK], np.full(len(_TRUNK), np.nan)).depth
        if not np.isfinite(body).any():
            return None
        position = np.where(known[:, None], position, (0.0, 0.0, np.nanmedian(body)))
    front = trunk_turn(frame.depth, pixels[_TRUNK], frame.intrinsics) - calibration.front
    pixels[SHOULDERS] += shoulder_shift(calibration.up_camera, position[SHOULDERS, 2].mean(), frame.intrinsics)
    offsets, share = OFFSETS.copy(), np.ones(len(TRACKED))
    arms = position[ARMS].reshape(2, 3, 3)
    sure = np.ones(2)
    if known[ARMS].all():
        sure = shoulders_seen(arms)
        hands = hands_before(arms)
        offsets[WRISTS] += HAND * hands
        share[WRISTS] -= (1.0 - HAND_SHARE) * hands
    patches = patch_depths(frame.depth, pixels, position[:, 2] - offsets, share)
    depth = patches.depth + offsets
    depth[~(np.abs(depth - position[:, 2]) <= np.where(known, _WINDOW, _WINDOW.max()))] = np.nan
    torso = middle(depth[_TRUNK])
    if math.isnan(torso):
        return None
    arms_depth = depth[ARMS]
    off = arms_depth - torso
    arms_depth[(off <= _REACH[0]) | (off >= _REACH[1])] = np.nan
    if known[ARMS].all():
        arms_depth[covered(arms, arms_depth.reshape(2, 3)).ravel()] = np.nan
    rays = frame.intrinsics.rays(np.where(seen[:, None], pixels, 0.0))
    sigma = np.maximum(patches.sigma, DEPTH_SIGMA) / (1.5 * patches.share).clip(0.3, 1.0)
    sigma[SHOULDERS] /= np.maximum(sure, _LEAST_SURE)
    along = np.where(np.isfinite(depth), DEPTH_SIGMA, GUESSED_SIGMA)
    return Surfaces(seen, rays, depth, sigma, sure, front, along, between(*rays[SHOULDERS]) * torso)


def _guessed(frame: RgbdFrame, landmarks: Landmarks, seen: Mask, calibration: Calibration) -> Surfaces | None:
    """The same without depth: what the pose model guesses, at the distance that fits the picture."""
    depth = model_depths(landmarks, seen, frame.intrinsics, calibration)
    if depth is None:
        return None
    pixels = np.where(seen[:, None], landmarks.pixels[TRACKED], 0.0)
    torso = float(between(*depth[SHOULDERS]))
    pixels[SHOULDERS] += shoulder_shift(calibration.up_camera, torso, frame.intrinsics)
    rays = frame.intrinsics.rays(pixels)
    sigma = np.full(len(TRACKED), MODEL_SIGMA)
    return Surfaces(seen, rays, depth, sigma, np.ones(2), math.nan, sigma, between(*rays[SHOULDERS]) * torso, True)


def lift(
    seen: Surfaces,
    landmarks: Landmarks,
    joints: JointFilter,
    calibration: Calibration,
    shoulders: Array | None = None,
) -> Lifted:
    """Place the joints on their rays.

    Args:
        seen: What was measured.
        landmarks: What the pose model found.
        joints: Where the last frames expect the joints.
        calibration: The operator.
        shoulders: Where the rest of the trunk has its shoulders, optical frame, shape (2, 3) [m]; None where it does
            not tell.

    Returns:
        The joints.
    """
    expected = np.where(joints.known, joints.position[:, 2], seen.place[2])
    expected_sigma = np.where(joints.known, np.minimum(joints.sigma[:, 2], _FIRST_SIGMA) + _SLACK, _FIRST_SIGMA)
    if shoulders is not None:
        expected[SHOULDERS], expected_sigma[SHOULDERS] = shoulders[:, 2], TRUNK_SIGMA
    relative = relative_depths(landmarks, calibration)
    rays = seen.rays[ARMS].reshape(2, 3, 3)
    measured, sigma = seen.depth[ARMS].reshape(2, 3), seen.sigma[ARMS].reshape(2, 3)
    fitted, _ = fit_depths(
        DepthEvidence(
            rays=rays,
            measured=measured,
            sigma=sigma,
            prior=expected[ARMS].reshape(2, 3),
            prior_sigma=expected_sigma[ARMS].reshape(2, 3),
            lengths=calibration.lengths,
            relative=relative,
        )
    )
    across = np.array((PIXEL_SIGMA, PIXEL_SIGMA))
    across[:, 0] /= np.maximum(seen.sure, _LEAST_SURE)
    arms = fit_arms(
        ArmEvidence(
            rays=rays,
            across=across,
            measured=measured,
            sigma=sigma,
            trunk=_NOWHERE if shoulders is None else shoulders,
            trunk_sigma=_TRUNK_SIGMAS,
            lengths=calibration.lengths,
            relative=relative,
        ),
        fitted[..., None] * rays,
    )
    # A whole arm has the places that fit its limbs; of a part of one only what was measured counts.
    usable = np.isfinite(seen.depth)
    places = np.where(usable, seen.depth, 0.0)[:, None] * seen.rays
    whole = seen.seen[ARMS].reshape(2, 3).all(axis=1)
    usable[ARMS].reshape(2, 3)[whole] = True
    places[ARMS].reshape(2, 3, 3)[whole] = arms[whole]
    usable &= seen.seen
    spread = np.full((len(TRACKED), 3), ACROSS_SIGMA)
    spread[:, 2] = seen.along
    if shoulders is not None:
        behind = ~usable[SHOULDERS]
        if behind.any():
            unseen = SHOULDERS[behind]
            places[unseen], spread[unseen], usable[unseen] = shoulders[behind], GUESSED_SIGMA, True
    # Where nothing is measured, the comparisons are false.
    off = (seen.depth[ARMS] - places[ARMS, 2]).reshape(2, 3)[:, 1:]
    confirmed = (np.abs(off) < _CONFIRMED).any(axis=1) & ~(off < -_CONFIRMED).any(axis=1)
    if shoulders is not None:
        # What drags a shoulder out of the trunk is no arm.
        confirmed &= length(arms[:, 0] - shoulders) < _CONFIRMED
    return Lifted(places, spread, usable, confirmed | seen.guessed)


def relative_depths(landmarks: Landmarks, calibration: Calibration) -> Array:
    """How much deeper elbows are than shoulders and wrists than elbows, by the pose model.

    Returns:
        Shape (2, 2) [m]; NaN where the model does not say. It does not know how large people are, so its arms are
        scaled to the operator's.
    """
    if landmarks.world is None:
        return np.full((2, 2), np.nan)
    arms = landmarks.world[TRACKED[ARMS]].reshape(2, 3, 3)
    limbs = arms[:, 1:] - arms[:, :-1]
    modelled = length(limbs).sum(axis=1)
    scale = calibration.lengths.sum(axis=1) / np.maximum(modelled, 1e-3)
    return limbs[..., 2] * scale[:, None]
