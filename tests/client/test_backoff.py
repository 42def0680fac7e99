"""When a failing service is tried again."""

from hypothesis import given
from hypothesis import strategies as st

from ik_client.backoff import Backoff


@given(st.lists(st.booleans(), max_size=30))
def test_backoff_pauses_only_after_two_failures_in_a_row_and_never_long(outcomes):
    backoff, now, streak = Backoff(first=0.02, limit=0.5), 0.0, 0
    for good in outcomes:
        if good:
            backoff.succeeded()
        else:
            backoff.failed(now)
        streak = 0 if good else streak + 1
        assert backoff.pausing(now) is (streak >= 2)
        assert not backoff.pausing(now + 0.5)
        now += 1.0
