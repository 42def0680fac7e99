"""Who may open a socket: the right token from the right page, and nobody else."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xr_client.door import Door

TOKEN = "b7c1e5d2a9"
DOOR = Door(TOKEN, ["192.168.1.20", "Robot.local"])


@pytest.mark.parametrize(
    ("origin", "asked"),
    [
        ("https://192.168.1.20:8443", "192.168.1.20:8443"),
        ("https://robot.local:8443", "robot.local:8443"),
        ("https://ROBOT.local", "robot.LOCAL"),
        ("http://localhost:8080", "localhost:8080"),
        ("http://127.0.0.1:8080", "127.0.0.1:8080"),
        ("http://[::1]:8080", "[::1]:8080"),
    ],
)
def test_pages_served_here_pass(origin, asked):
    assert DOOR.origin_fault(origin, asked) is None


@pytest.mark.parametrize(
    ("origin", "asked", "words"),
    [
        (None, "robot.local:8443", "only pages served here"),
        ("", "robot.local:8443", "only pages served here"),
        ("null", "robot.local:8443", "only pages served here"),
        ("file://", "robot.local:8443", "only pages served here"),
        ("https://robot.local:8443/", "robot.local:8443", "only pages served here"),
        ("https://evil@robot.local:8443", "evil@robot.local:8443", "only pages served here"),
        ("https://evil.example", "robot.local:8443", "served by somebody else"),
        ("https://robot.local:9", "robot.local:8443", "served by somebody else"),
        ("https://robot.local.evil.example:8443", "robot.local.evil.example:8443", "not known by that name"),
        ("https://rebound.evil.example", "rebound.evil.example", "not known by that name"),
        ("http://localhost.evil.example", "localhost.evil.example", "not known by that name"),
        ("http://192.168.1.20:8080", "192.168.1.20:8080", "without TLS"),
    ],
)
def test_others_do_not(origin, asked, words):
    assert words in str(DOOR.origin_fault(origin, asked))


@given(st.text(max_size=30), st.text(max_size=30))
def test_no_origin_is_made_up(origin, asked):
    """Whatever is sent: a line of words, or a page of ours."""
    fault = DOOR.origin_fault(origin, asked)
    assert fault is None or len(fault.splitlines()) == 1


def test_the_token():
    assert DOOR.token_fault(TOKEN) is None
    assert "missing" in str(DOOR.token_fault(None))
    assert "missing" in str(DOOR.token_fault(""))


@given(
    st.text(min_size=1, max_size=12) | st.sampled_from([TOKEN[:-1], TOKEN + "x", TOKEN.upper(), " " + TOKEN, "\ud800"])
)
def test_a_wrong_token(token):
    if token != TOKEN:
        assert "wrong token" in str(DOOR.token_fault(token))


def test_a_door_needs_a_lock():
    with pytest.raises(ValueError, match="empty"):
        Door("", [])
