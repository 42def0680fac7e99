"""`Service` and `solve_batch`: a batch is its rows, and is refused as a whole."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from service_fakes import batch_of, service_with

from ik_proto import JSON, MSGPACK, BatchReply, Codec, SolveReply, Status, gravest, parse_batch_reply
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service


@pytest.fixture
def service(engine: Engine) -> Service:
    return Service(engine.copy(), Meter("test"))


@pytest.mark.parametrize("collision", ["off", "avoid"])
@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_a_batch_is_its_rows(
    service: Service, document: Callable[..., dict[str, Any]], codec: Codec, collision: str
) -> None:
    far = np.eye(4)
    far[1, 3] = 2.0  # to the left, where nothing is in the way
    documents = [document(seed, collision=collision) for seed in range(5)] + [
        document(9, left_wrist=far.tolist(), collision=collision)
    ]
    body = codec.encode(batch_of(documents, id=77))
    batch = parse_batch_reply(codec.decode(service.handle_bytes(body, codec)), len(documents), 14)
    alone = [service.handle(row) for row in documents]
    assert batch.id == 77
    assert batch.success
    assert batch.error == ""
    assert batch.status is gravest(batch.statuses) is Status.UNREACHABLE
    assert [row.status for row in alone] == batch.statuses
    assert all(isinstance(row, SolveReply) for row in alone)
    for name in ("sol_q", "tau", "position_error", "rotation_error"):
        np.testing.assert_array_equal(getattr(batch, name), [getattr(row, name) for row in alone])
    if collision == "off":
        assert batch.clearance is None
    else:
        np.testing.assert_array_equal(batch.clearance, [getattr(row, "clearance", None) for row in alone])
    assert batch.start == [0] * 6
    assert batch.iterations == sum(getattr(row, "iterations", 0) for row in alone)


def test_a_batch_with_a_row_to_hold_says_so(engine: Engine, document: Callable[..., dict[str, Any]]) -> None:
    service = service_with(engine, Status.NOT_CONVERGED)
    reply = service.handle(batch_of([document(seed) for seed in range(3)]))
    assert isinstance(reply, BatchReply)
    assert (reply.status, reply.success) == (Status.NOT_CONVERGED, False)
    assert reply.statuses == [Status.OK, Status.NOT_CONVERGED, Status.NOT_CONVERGED]
    assert reply.error.startswith("2 of 3 rows are not converged")
    np.testing.assert_array_equal(reply.sol_q[2], document(2)["q"])


@pytest.mark.parametrize(
    ("changes", "status", "words"),
    [
        ({"q": [[0.0] * 14, [0.0] * 13]}, Status.BAD_REQUEST, "q"),
        ({"left_wrist": [np.eye(4).tolist(), np.zeros((4, 4)).tolist()]}, Status.BAD_REQUEST, "left_wrist[1]"),
        ({"preset": "fancy"}, Status.UNSUPPORTED, "openwbt, precise"),
        ({"waist": [[0.0] * 3, [math.nan] * 3]}, Status.BAD_REQUEST, "waist[1]"),
    ],
)
def test_a_batch_that_is_refused_has_no_joints_to_give_back(
    service: Service, document: Callable[..., dict[str, Any]], changes: dict[str, Any], status: Status, words: str
) -> None:
    reply = service.handle({**batch_of([document(seed) for seed in range(2)]), **changes, "id": 5})
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.success, reply.id, reply.sol_q) == (status, False, 5, None)
    assert words in reply.error
    assert "\n" not in reply.error


def test_a_fault_of_ours_in_a_batch_has_no_joints_either(
    engine: Engine, document: Callable[..., dict[str, Any]]
) -> None:
    service = service_with(engine, RuntimeError("secret"))
    reply = service.handle(batch_of([document(seed) for seed in range(2)], id=5))
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.id, reply.sol_q) == (Status.INTERNAL, 5, None)
