"""Presets: what the G1's hold, and one line for a wrong one."""

from dataclasses import replace

import numpy as np
import pytest

from ik_proto.robots import RobotDescription, RobotError
from ik_service.preset import Preset

FOUR = {"position": 1.0, "rotation": 1.0, "regularization": 1.0, "smoothness": 1.0}


def test_openwbt_has_the_seeds_weights(preset: Preset) -> None:
    weights = (preset.position, preset.rotation, preset.regularization, preset.smoothness)
    assert weights == (50.0, 1.0, 0.02, 0.1)
    assert (preset.elbow, preset.hyperextension, preset.retreat) == (0.0, 0.0, 0.0)


def test_precise_weighs_errors_alike_and_calls_a_target_reached_within_a_millimetre_and_a_degree(
    preset: Preset, precise: Preset
) -> None:
    assert (precise.position, precise.rotation) == (preset.position, preset.rotation)
    assert precise.regularization + precise.smoothness < 0.01 * (preset.regularization + preset.smoothness)
    assert precise.unreachable_position == 1e-3
    assert precise.unreachable_rotation == pytest.approx(0.01745)
    assert precise.restarts == 0  # a tracked path is never torn


def test_what_is_left_out_has_defaults(description: RobotDescription) -> None:
    plain = Preset.of(replace(description, presets={"mine": FOUR}), "mine")
    assert plain == Preset("mine", 1.0, 1.0, 1.0, 1.0)
    assert (plain.restarts, plain.unreachable_position) == (0, 0.025)


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        ({"position": 1.0, "rotation": 1.0, "regularization": 1.0}, "needs smoothness"),
        ({**FOUR, "position": -1.0}, "needs position"),
        ({**FOUR, "position": float("nan")}, "needs position"),
        ({**FOUR, "regularization": 0.0, "smoothness": 0.0}, "above zero"),
        ({**FOUR, "manipulability": 1.0}, "has no use for manipulability"),
        ({**FOUR, "hyperextension": -1.0}, "hyperextension"),
        ({**FOUR, "restarts": -1.0}, "restarts"),
        ({**FOUR, "restarts": 1.5}, "restarts"),
    ],
)
def test_wrong_preset_is_one_line(description: RobotDescription, weights: dict[str, float], words: str) -> None:
    with pytest.raises(RobotError, match=words) as caught:
        Preset.of(replace(description, presets={"mine": weights}), "mine")
    assert "\n" not in str(caught.value)


def test_unknown_preset_lists_the_known(description: RobotDescription) -> None:
    with pytest.raises(RobotError, match="no preset fast; it has openwbt, precise"):
        Preset.of(description, "fast")


def test_tolerance_forgets_what_is_free(precise: Preset) -> None:
    p, w = precise.unreachable_position, precise.unreachable_rotation
    assert precise.tolerance(None).tolist() == [p, p, w, w]
    assert precise.tolerance(np.full((2, 2), 0.1)).tolist() == [p, p, w, w]
    assert precise.tolerance(np.array([[0.0, 1.0], [1.0, 1.0]])).tolist() == [np.inf, p, w, w]
    rows = np.array([[[1.0, 0.0], [1.0, 1.0]], [[1.0, 1.0], [0.0, 0.0]]])
    assert precise.tolerance(rows).tolist() == [[p, p, np.inf, w], [p, np.inf, w, np.inf]]
