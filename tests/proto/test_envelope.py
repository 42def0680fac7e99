"""The envelope: what may be said, what is refused, and that it is read the same for every verb."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto import JSON, MSGPACK, Envelope, RequestError, SolveRequest, Status, parse_request, read_envelope
from ik_proto.limits import MAX_BUDGET_MS, MAX_STREAM_CHARACTERS

N = 14
POSE, Q = np.eye(4).tolist(), [0.1] * N
REQUESTS: dict[str, dict[str, Any]] = {
    "solve": {"left_wrist": POSE, "right_wrist": POSE, "q": Q, "dq": Q},
    "solve_batch": {"verb": "solve_batch", "left_wrist": [POSE], "right_wrist": [POSE], "q": [Q]},
    "fk": {"verb": "fk", "q": Q},
    "info": {"verb": "info"},
}
WHOLE = {"token": "secret", "stream": "s" * MAX_STREAM_CHARACTERS, "budget_ms": 2.5}


@pytest.mark.parametrize("verb", REQUESTS)
@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_every_verb_may_carry_one_and_is_the_same_request(verb: str, codec: Any) -> None:
    document = codec.decode(codec.encode(REQUESTS[verb] | WHOLE))
    assert read_envelope(document) == Envelope("secret", "s" * MAX_STREAM_CHARACTERS, 2.5)
    got, plain = parse_request(document, N), parse_request(REQUESTS[verb], N)
    assert type(got) is type(plain)
    if isinstance(got, SolveRequest) and isinstance(plain, SolveRequest):
        assert np.array_equal(got.q, plain.q)


@pytest.mark.parametrize("document", [{}, dict.fromkeys(WHOLE)], ids=["absent", "null"])
def test_absent_and_null_are_the_defaults(document: dict[str, Any]) -> None:
    assert read_envelope(document) == Envelope("", "", None)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"token": 7}, "token must be a string"),
        ({"stream": ["s"]}, "stream must be a string"),
        ({"stream": "s" * (MAX_STREAM_CHARACTERS + 1)}, "stream must have at most 64 characters, not 65"),
        ({"budget_ms": 0}, "budget_ms must be above 0 and at most 10000"),
        ({"budget_ms": -0.001}, "budget_ms must be above 0"),
        ({"budget_ms": MAX_BUDGET_MS + 1}, "budget_ms must be above 0 and at most 10000"),
        ({"budget_ms": float("nan")}, "budget_ms must be a finite number"),
        ({"budget_ms": float("inf")}, "budget_ms must be a finite number"),
        ({"budget_ms": True}, "budget_ms must be a finite number"),
        ({"budget_ms": "10"}, "budget_ms must be a finite number"),
    ],
    ids=str,
)
@pytest.mark.parametrize("verb", REQUESTS)
def test_a_wrong_one_is_refused_in_one_line(verb: str, fault: dict[str, Any], words: str) -> None:
    document = REQUESTS[verb] | fault
    with pytest.raises(ValueError, match=words):
        read_envelope(document)
    with pytest.raises(RequestError, match=words) as refusal:
        parse_request(document | {"id": 3}, N)
    assert (refusal.value.status, refusal.value.id) == (Status.BAD_REQUEST, 3)


def test_keys_of_openwbts_form_are_its_own_business() -> None:
    document = {"left_wrist": POSE, "right_wrist": POSE, "current_lr_arm_q": Q, "current_lr_arm_dq": Q}
    for extra in (WHOLE, {"stream": 7, "budget_ms": "soon", "token": []}):
        assert read_envelope(document | extra) == Envelope()
        assert isinstance(parse_request(document | extra, N), SolveRequest)


@given(st.dictionaries(st.sampled_from(list(WHOLE)), st.none() | st.floats() | st.integers() | st.text(max_size=80)))
def test_anything_is_read_within_its_bounds_or_refused(document: dict[str, Any]) -> None:
    """Hazard row: malformed frame."""
    try:
        envelope = read_envelope(document)
    except ValueError as error:
        assert "\n" not in str(error)
        return
    assert len(envelope.stream) <= MAX_STREAM_CHARACTERS
    assert envelope.budget_ms is None or 0.0 < envelope.budget_ms <= MAX_BUDGET_MS
