"""What counts as a leap of an arm, and that a leap is shown as a motion."""

import numpy as np
import pytest
from painted_person import DOWN, FORWARD, FPS, LEFT, limbs, look

from camera_client import leap_watch
from camera_client.calibration import TYPICAL
from camera_client.chain import Chain
from camera_client.leap_watch import ACCELERATION, LeapWatch
from camera_client.vectors import rotate

DT = 1.0 / FPS
LENGTHS = TYPICAL.lengths
HANGING = limbs((DOWN, FORWARD), (DOWN, FORWARD))


def turned(angle: float) -> np.ndarray:
    """Forearms of both arms turned upward by an angle [rad]."""
    out = HANGING.copy()
    out[:, 1] = rotate(out[:, 1], np.array([0.0, -angle, 0.0]))
    return out


def test_the_first_frame_and_one_of_the_same_time_are_none():
    watch = LeapWatch()
    assert not watch.update(HANGING, LENGTHS, DT).any()
    assert not watch.update(turned(1.0), LENGTHS, 0.0).any()


@pytest.mark.parametrize("rate", [0.0, 3.0, 9.0])
def test_an_even_turn_is_none_however_fast(rate: float):
    watch = LeapWatch()
    watch.update(HANGING, LENGTHS, DT)
    watch.update(turned(rate * DT), LENGTHS, DT)
    # A lost frame is a longer step.
    times = np.cumsum([2 * DT, DT, DT, 3 * DT, DT])
    for before, t in zip([DT, *(DT + times[:-1])], DT + times, strict=True):
        assert not watch.update(turned(rate * t), LENGTHS, float(t - before)).any()


def test_it_begins_where_no_hand_could_have_gone():
    for share, expected in ((0.9, False), (1.1, True)):
        watch = LeapWatch()
        watch.update(HANGING, LENGTHS, DT)
        watch.update(HANGING, LENGTHS, DT)
        # The chord of the forearm's turn.
        angle = 2.0 * np.arcsin(0.5 * share * ACCELERATION * DT * DT / LENGTHS[0, 1])
        now = turned(float(angle))
        now[1] = HANGING[1]
        assert watch.update(now, LENGTHS, DT).tolist() == [expected, False]


def steps_of_a_flip() -> np.ndarray:
    """Steps of the left wrist [m] while its forearm is shown somewhere else from a frame to the next."""
    chain, wrists = Chain(TYPICAL), []
    for k in range(60):
        flip = 0.42 if k >= 30 else 0.0
        shown = limbs((DOWN + 0.3 * LEFT, FORWARD + flip * DOWN), (DOWN - 0.3 * LEFT, FORWARD))
        estimate = chain.update(*look(1.0 + k * DT, shown))
        assert estimate is not None
        wrists.append(estimate.joints[0, 2])
    return np.linalg.norm(np.diff(wrists, axis=0), axis=-1)[5:]


def test_a_leap_is_shown_as_a_motion(monkeypatch: pytest.MonkeyPatch):
    assert steps_of_a_flip().max() < 0.035
    # The negative control: what would be shown without a watch.
    monkeypatch.setattr(leap_watch, "ACCELERATION", np.inf)
    assert steps_of_a_flip().max() > 0.06
