"""Requests and replies of the verb `velocity`: accepted, or refused in a line that says why."""

from typing import Any

import jsonschema
import numpy as np
import pytest
from test_contract import read, validator

from ik_proto import JSON, MSGPACK, ReplyError, RequestError, VelocityRequest, parse_request, parse_velocity_reply
from ik_proto import request_document as written


@pytest.mark.parametrize("codec", [JSON, MSGPACK])
@pytest.mark.parametrize("name", ["velocity_request", "boxed_velocity_request"])
def test_round_trip(codec: Any, name: str) -> None:
    first = parse_request(read(name), 14)
    assert isinstance(first, VelocityRequest)
    again = parse_request(codec.decode(codec.encode(written(first))), 14)
    for field in VelocityRequest.__slots__:
        assert np.array_equal(getattr(first, field), getattr(again, field)), field


def test_what_is_left_out_has_defaults() -> None:
    document = {"verb": "velocity", "left_twist": [0.1] * 3, "right_twist": [0.1] * 6, "q": [0.0] * 14}
    request = parse_request(document, 14)
    assert isinstance(request, VelocityRequest)
    assert (request.frame, request.law, request.hold_left, request.max_speed) == ("pelvis", "adaptive", True, 1.5)
    assert request.dq is None
    assert request.left_twist.shape == (3,)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"left_twist": [0.1] * 4}, "left_twist"),
        ({"left_twist": 0.1}, "left_twist"),
        ({"right_twist": None}, "right_twist"),
        ({"frame": "world"}, "frame"),
        ({"law": 1}, "law"),
        ({"hold_left": 0}, "hold_left"),
        ({"damping": 0.0}, "damping"),
        ({"max_speed": -1}, "max_speed"),
        ({"max_acceleration": "fast"}, "max_acceleration"),
        ({"period": 2.0}, "period"),
        ({"posture_gain": -0.1}, "posture_gain"),
        ({"left_bounds": [[0.0] * 3]}, "left_bounds"),
        ({"collision": "on"}, "collision"),
        ({"mode": "track"}, "mode"),
    ],
    ids=str,
)
def test_schema_and_code_refuse_alike(change: dict[str, Any], word: str) -> None:
    document = read("velocity_request") | change
    assert not validator("velocity_request").is_valid(document)
    with pytest.raises(RequestError, match=word) as caught:
        parse_request(document, 14)
    assert caught.value.q is not None
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"left_twist": [float("nan")] * 6}, "left_twist"),
        ({"left_twist": [200.0] * 3}, "beyond 100"),
        ({"q": [0.0] * 13}, "q must have shape"),
        ({"dq": [0.0] * 13}, "dq must have shape"),
        ({"left_bounds": [[1.0] * 3, [0.0] * 3]}, "smallest coordinates"),
    ],
    ids=str,
)
def test_code_refuses(change: dict[str, Any], word: str) -> None:
    with pytest.raises(RequestError, match=word):
        parse_request(read("velocity_request") | change, 14)


@pytest.mark.parametrize(
    "change",
    [
        {"dq": None},
        {"dq": [0.0] * 13},
        {"twists": [[0.0] * 6]},
        {"limited_by": ["", "fear"]},
        {"limited_by": "joint"},
        {"limiting_joint": [None, 1]},
        {"nearest": None},
        {"solve_us": None},
        {"success": False},
    ],
    ids=str,
)
def test_wrong_replies_are_refused(change: dict[str, Any]) -> None:
    parse_velocity_reply(read("velocity_reply"), 14)
    with pytest.raises(ReplyError, match="velocity reply"):
        parse_velocity_reply(read("velocity_reply") | change, 14)


def test_an_unmeasured_reply_is_read() -> None:
    document = {k: v for k, v in read("velocity_reply").items() if k not in ("clearance", "nearest")}
    jsonschema.validate(document, {**validator("velocity_reply").schema})
    assert parse_velocity_reply(document, 14).clearance is None
