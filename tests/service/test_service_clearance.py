"""`Service` and `clearance`: many postures in, a distance for each out."""

import json
from typing import Any

import numpy as np
import pytest
from service_fakes import OPEN

from ik_proto import JSON, MAX_POSTURES, MSGPACK, ClearanceReply, Codec, SolveReply, Status, parse_clearance_reply
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service


@pytest.fixture
def service(engine: Engine) -> Service:
    return Service(engine.copy(), Meter("test"))


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_every_posture_is_measured(service: Service, engine: Engine, codec: Codec) -> None:
    q = np.random.default_rng(1).uniform(engine.robot.lower, engine.robot.upper, (6, 14))
    waist = np.array([0.1, -0.05, 0.2])
    body = codec.encode(
        {"verb": "clearance", "q": q, "waist": waist, "id": 5}
        if codec is MSGPACK
        else {"verb": "clearance", "q": q.tolist(), "waist": waist.tolist(), "id": 5}
    )
    reply = parse_clearance_reply(codec.decode(service.handle_bytes(body, codec)), 6)
    assert (reply.status, reply.id, reply.boot_id) == (Status.OK, 5, "boot-of-test")
    expected, nearest = engine.gauge.copy().clearance(q, waist)
    np.testing.assert_array_equal(reply.clearance, expected)
    assert reply.nearest == nearest


def test_the_most_that_are_accepted(service: Service) -> None:
    reply = service.handle({"verb": "clearance", "q": [OPEN] * MAX_POSTURES})
    assert isinstance(reply, ClearanceReply)
    assert reply.clearance is not None
    assert reply.clearance.shape == (MAX_POSTURES,)
    assert np.ptp(reply.clearance) == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"q": []}, "q has 0 rows; 1 to 128 are accepted"),
        ({"q": [OPEN] * 129}, "q has 129 rows; 1 to 128 are accepted"),
        ({"q": OPEN}, "q must have rows of 14, even where there is only one"),
        ({"q": [OPEN, OPEN[:13]]}, "rows of one length"),
        ({"q": [OPEN, [1e3, *OPEN[1:]]]}, "q[1]"),
        ({"q": [OPEN], "waist": [0.0]}, "waist must have shape 3, not 1"),
        ({"q": [OPEN], "left_wrist": np.eye(4).tolist()}, "clearance has no field 'left_wrist'"),
        ({}, "q"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(service: Service, change: dict[str, Any], words: str) -> None:
    reply = service.handle({"verb": "clearance", "id": 3, **change})
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.id, reply.sol_q) == (Status.BAD_REQUEST, 3, None)
    assert words in reply.error
    assert "\n" not in reply.error


def test_a_number_that_is_none_is_found(service: Service) -> None:
    """Hazard: NaN / Inf."""
    body = json.dumps({"verb": "clearance", "q": [OPEN, [float("nan"), *OPEN[1:]]]}).encode()
    document = JSON.decode(service.handle_bytes(body, JSON))
    assert document["status"] == "bad_request"
    assert "q[1]" in document["error_msg"]
