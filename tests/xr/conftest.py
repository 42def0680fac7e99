"""What the tests of the XR client share."""

import numpy as np
import pytest
from xr_samples import read_hand


@pytest.fixture(params=["pinch", "point", "relaxed"])
def captured_hand(shared_data, request) -> tuple[str, np.ndarray]:
    """Name and joints, shape (25, 4, 4), of a hand that a real headset saw."""
    return request.param, read_hand(shared_data / "human" / "webxr_hands" / f"{request.param}.js")
