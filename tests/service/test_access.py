"""The doorkeeper: who is admitted, and that nothing behind it sees the token."""

import hmac
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_service.access import Doorkeeper

TOKEN = "c2VjcmV0LXNlY3JldC1zZWNyZXQ"


def keeper(remembers: bool = True) -> Doorkeeper:
    return Doorkeeper(TOKEN.encode(), remembers)


def test_without_a_token_everybody_is_admitted_and_none_is_handed_on() -> None:
    anybody = Doorkeeper(None, remembers=False)
    request: dict[str, Any] = {"verb": "info", "token": "whatever"}
    assert anybody.admits(request)
    assert request == {"verb": "info"}
    assert anybody.reads_unseen


def test_a_connection_shows_it_once() -> None:
    """Hazard row: auth."""
    door = keeper()
    assert not door.reads_unseen
    assert not door.admits({"verb": "info"})
    request = {"verb": "info", "token": TOKEN}
    assert door.admits(request)
    assert request == {"verb": "info"}
    assert door.reads_unseen
    assert door.admits({"verb": "info"})
    assert door.admits({"verb": "info", "token": "wrong"})  # what is trusted is trusted


def test_where_nothing_is_remembered_each_request_shows_it() -> None:
    """Hazard row: auth."""
    door = keeper(remembers=False)
    assert door.reads_unseen  # a query has nothing in front of it that could have shown the token
    assert door.admits({"token": TOKEN})
    assert not door.admits({})
    assert door.admits({"token": TOKEN})


@pytest.mark.parametrize(
    "shown", [None, 3, True, ["x"], {}, TOKEN.encode(), "", TOKEN[:-1], TOKEN + "x", TOKEN.upper()]
)
def test_anything_else_is_turned_away_and_taken_out(shown: Any) -> None:
    door = keeper()
    request = {"token": shown}
    assert not door.admits(request)
    assert request == {}
    assert not door.reads_unseen


@given(st.text() | st.sampled_from(["\ud800", TOKEN + "\udfff", "é" * 30]))
def test_no_text_but_the_token_is_admitted(shown: str) -> None:
    assert keeper().admits({"token": shown}) is (shown == TOKEN)


def test_what_json_decodes_is_no_trap() -> None:
    assert not keeper().admits(json.loads('{"token": "\\ud800"}'))


def test_tokens_are_compared_in_constant_time(monkeypatch: pytest.MonkeyPatch) -> None:
    compared = []

    def spy(shown: bytes, token: bytes) -> bool:
        compared.append((shown, token))
        return shown == token

    monkeypatch.setattr(hmac, "compare_digest", spy)
    assert not keeper().admits({"token": "wrong"})
    assert keeper().admits({"token": TOKEN})
    assert compared == [(b"wrong", TOKEN.encode()), (TOKEN.encode(), TOKEN.encode())]
