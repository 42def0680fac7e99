"""`Allowance`: never more than it promises, and what it says to wait is enough."""

from hypothesis import given
from hypothesis import strategies as st

from ik_service.allowance import Allowance

gaps = st.lists(st.floats(0.0, 0.05), min_size=1, max_size=200)


@given(gaps=gaps, per_s=st.floats(1.0, 1e4), burst=st.integers(1, 50))
def test_no_window_grants_more_than_burst_and_rate(gaps: list[float], per_s: float, burst: int) -> None:
    """Hazard row: slowloris / flood."""
    allowance, now, granted = Allowance(per_s, burst, 0.0), 0.0, []
    for gap in gaps:
        now += gap
        if allowance.take(now) == 0.0:
            granted.append(now)
    for first, begin in enumerate(granted):
        for last in range(first, len(granted)):
            assert last - first + 1 <= burst + (granted[last] - begin) * per_s + 1e-6


@given(per_s=st.floats(1.0, 1e4), burst=st.integers(1, 50))
def test_a_burst_is_granted_at_once_and_the_next_after_the_wait(per_s: float, burst: int) -> None:
    allowance, now = Allowance(per_s, burst, 5.0), 5.0
    assert [allowance.take(now) for _ in range(burst)] == [0.0] * burst
    wait_s = allowance.take(now)
    assert 0.0 < wait_s <= 1.0 / per_s
    assert allowance.take(now + 0.9 * wait_s) > 0.0
    assert allowance.take(now + wait_s * (1.0 + 1e-6) + 1e-12 + 2e-6 / per_s) == 0.0
