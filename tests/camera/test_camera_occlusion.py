"""An arm behind a board, on a rendered person: held, found again, and never twisted or thrown, whatever is guessed."""

from dataclasses import replace

import numpy as np
import pytest
from arm_metrics import JUMP, SPIKE, angle_between
from choreography import Choreography
from rendered_person import INTRINSICS, RenderedPerson
from sequence import Moment, Observer, calibrated, moments

from camera_client.chain import Chain
from camera_client.estimate import ArmsEstimate

COVERED_FROM = 1.5
BEFORE = 0.65
"""How far the board is in front of the body: further than the hand, which it would cut otherwise [m]."""


def dance(seconds: float) -> Choreography:
    """The left arm goes from one posture to another while it is covered; the right one waves all the time."""
    back = COVERED_FROM + seconds
    keys = (
        (0.0, "e90", "goal"),
        (COVERED_FROM, "e90", "goal"),
        (back, "e90out", "goal"),
        (back + 1.5, "e90out", "goal"),
    )
    return Choreography(keys, wave=(0.5, back + 1.5))


def boarded(now: Moment) -> Moment:
    """The same with a board before the left arm, which is on the right of the picture."""
    pixels = INTRINSICS.project(now.in_camera)
    depth = now.depth.copy()
    # From the edge of the upper arm outwards, over the whole height.
    begin = int(min(pixels[0, 0] + 4.0, pixels[1:3, 0].min() - 12.0))
    depth[:, begin:] = np.minimum(depth[:, begin:], now.in_camera[:, 2].mean() - BEFORE)
    return replace(now, depth=depth)


@pytest.mark.parametrize("seconds", [0.5, 2.0])
@pytest.mark.parametrize("landmarks_are", ["lost", "made up"])
def test_a_covered_arm_is_held_and_found_again(scene: RenderedPerson, seconds: float, landmarks_are: str):
    """Hazard: covered limb."""
    observer = Observer.seeded(7)
    # Made up landmarks are those of an arm that hangs, as sure as any.
    hanging = next(moments(scene, Choreography(((0.0, "hang", "hang"), (1.0, "hang", "hang"))))).in_camera
    chain = Chain(calibrated(scene, observer))
    estimates: list[ArmsEstimate] = []
    truth, times = [], []
    back = COVERED_FROM + seconds
    for now in moments(scene, dance(seconds)):
        covered = COVERED_FROM <= now.t < back
        shown = boarded(now) if covered else now
        if covered and landmarks_are == "made up":
            frame, _ = observer.look(shown)
            invented = now.in_camera.copy()
            invented[1:3] = hanging[1:3] - hanging[0] + now.in_camera[0]
            landmarks = observer.model_noise.look(invented, 1.0 / 30.0)
        else:
            frame, landmarks = observer.look(shown, (0,) if covered else ())
        estimate = chain.update(frame, landmarks)
        assert estimate is not None
        estimates.append(estimate)
        truth.append(now.in_pelvis)
        times.append(now.t)
    t, G = np.array(times), np.array(truth)
    joints = np.array([estimate.joints for estimate in estimates])
    R = np.array([estimate.R_pelvis_wrist for estimate in estimates])
    tracked = np.array([estimate.tracked for estimate in estimates])
    # It takes a moment to notice.
    held = (t >= COVERED_FROM + 0.3) & (t < back)
    assert not tracked[held, 0].any()
    assert np.allclose(joints[held, 0] - joints[held, 0, :1], (joints[held, 0] - joints[held, 0, :1])[0])
    assert tracked[:, 1].all(), [(e.t_capture, e.note) for e in estimates if not e.tracked[1]]
    assert np.linalg.norm(joints[held, 0, 2] - joints[t < COVERED_FROM][-1, 0, 2], axis=-1).max() < 0.08
    # Neither a twist nor a jump, when it is lost, held and found again.
    assert angle_between(R[1:], R[:-1]).max() < JUMP
    step = np.linalg.norm(np.diff(joints[:, :, 2], axis=0), axis=-1)
    step_true = np.linalg.norm(np.diff(G[:, :, 2], axis=0), axis=-1)
    assert (step - step_true).max() < SPIKE
    found = t >= back + 1.0
    assert tracked[found].all()
    assert np.linalg.norm(joints - G, axis=-1)[found, 0, 2].mean() < 0.06
