"""The lease: one source at a time, and each of its commands once."""

import pytest

from ik_client.robot_end.lease import LEASE, Lease, Reception


def test_the_first_that_sends_holds_it_as_long_as_it_goes_on():
    lease = Lease()
    for k in range(100):
        now = 0.9 * LEASE * k
        assert lease.admit("a", k, now) is Reception.ACCEPTED
        assert lease.admit("b", k, now) is Reception.BUSY


@pytest.mark.parametrize(("silence", "reception"), [(LEASE, Reception.BUSY), (LEASE + 1e-6, Reception.ACCEPTED)])
def test_after_a_second_of_silence_another_may_have_it(silence, reception):
    lease = Lease()
    lease.admit("a", 1, 0.0)
    assert lease.admit("b", 1, silence) is reception


def test_a_rival_does_not_keep_the_lease_alive():
    lease = Lease()
    lease.admit("a", 1, 0.0)
    for k in range(1, 11):
        lease.admit("b", k, 0.1 * k)
    assert lease.admit("b", 11, 1.01) is Reception.ACCEPTED


def test_old_commands_do_not_keep_the_lease_alive():
    lease = Lease()
    lease.admit("a", 5, 0.0)
    assert lease.admit("a", 5, 0.9) is Reception.OLD
    assert lease.admit("b", 1, 1.1) is Reception.ACCEPTED


def test_a_freed_lease_is_anybodys():
    lease = Lease()
    lease.admit("a", 1, 0.0)
    lease.free()
    assert lease.admit("b", 1, 0.01) is Reception.ACCEPTED


def test_a_recording_of_a_session_cannot_be_played_after_it():
    """Hazard row "replay / reorder"."""
    lease = Lease()
    for seq in range(50):
        lease.admit("a", seq, 0.01 * seq)
    lease.admit("b", 1, 10.0)
    assert {lease.admit("a", seq, 20.0 + 0.01 * seq) for seq in range(50)} == {Reception.OLD}
    assert lease.admit("a", 50, 30.0) is Reception.ACCEPTED


def test_what_is_remembered_of_sessions_is_bounded():
    lease = Lease()
    for k in range(1000):
        lease.admit(f"session {k}", 1, 10.0 * k)
    assert len(lease._last_seq) <= 64
    assert lease.admit("session 999", 1, 1e6) is Reception.OLD


def test_a_clock_that_steps_back_does_not_keep_a_lease_for_ever():
    """Hazard row "clock skew", at the robot."""
    lease = Lease()
    lease.admit("a", 1, 1e9)
    assert lease.admit("b", 1, 0.0) is Reception.ACCEPTED
