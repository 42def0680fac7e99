"""Going home: the document's P controller, straight through the joint space."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_client.homing import ARRIVED, Homing

N = 14
JOINTS = hnp.arrays(np.float64, N, elements=st.floats(-3.0, 3.0))


@given(q=JOINTS, target=JOINTS)
def test_it_leads_straight_home_and_no_faster_than_it_may(q, target):
    velocity = Homing(target).velocity(q)
    assert np.abs(velocity).max() <= 0.5 * (1 + 1e-12)
    way = target - q
    # Along the way: the same direction as the way itself, and none at home.
    assert velocity @ way == pytest.approx(np.linalg.norm(velocity) * np.linalg.norm(way), rel=1e-9, abs=1e-12)


def test_near_home_it_is_the_documents_law():
    """`clip(error * 2.0, -0.5, 0.5)`, where nothing is clipped."""
    q = np.linspace(-0.2, 0.2, N)
    np.testing.assert_allclose(Homing(np.zeros(N)).velocity(q), np.clip((0.0 - q) * 2.0, -0.5, 0.5), atol=1e-15)


@given(q=JOINTS)
def test_it_arrives_within_the_time_of_its_own_law(q):
    homing, dt = Homing(np.zeros(N)), 0.02
    distance = float(np.abs(q).max())
    # Full speed down to 0.25 rad, then exponentially with the gain down to a hundredth.
    ticks = int((max(0.0, distance - 0.25) / 0.5 + np.log(0.25 / ARRIVED) / 2.0) / dt) + 3
    for _ in range(ticks):
        q = q + homing.velocity(q) * dt
    assert homing.arrived(q)
    assert not homing.arrived(q + 2.0 * ARRIVED)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((np.full(3, np.nan),), "finite numbers"),
        ((0.0,), "vector"),
        ((np.zeros(3), 0.0), "positive numbers, not 0.0"),
        ((np.zeros(3), 2.0, float("inf")), "positive numbers"),
    ],
)
def test_what_is_no_home_is_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        Homing(*arguments)
