"""The hold-to-run switch: any of a few devices, and no reading for ever."""

import pytest

from camera_client.enable import FRESH, Enable


class Switch:
    def __init__(self, held: bool | None) -> None:
        self.held = held


@pytest.mark.parametrize(
    ("states", "held"),
    [
        ([True], True),
        ([False], False),
        ([None], None),
        ([False, True], True),
        ([None, True], True),
        ([None, False], None),
        ([False, False], False),
        ([], None),
    ],
)
def test_any_of_the_devices_will_do(states, held):
    enable = Enable([Switch(state) for state in states])
    assert enable.held(0.0) is None  # nobody has looked
    enable.read(5.0)
    assert enable.held(5.0) is held


def test_a_reading_grows_old():
    """Hazard: switch gone."""
    switch = Switch(True)
    enable = Enable([switch])
    enable.read(5.0)
    assert enable.held(5.0 + 0.99 * FRESH) is True
    assert enable.held(5.0 + 1.01 * FRESH) is None
    assert enable.held(4.9) is None
    switch.held = False
    assert enable.held(5.0 + 0.5 * FRESH) is True  # as it was read
    enable.read(5.2)
    assert enable.held(5.2) is False
