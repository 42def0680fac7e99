"""Replies: the keys an OpenWBT client reads come first, and a client of ours believes nothing unchecked."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from ik_proto import (
    JSON,
    MSGPACK,
    Codec,
    FkReply,
    InfoReply,
    ReplyError,
    SolveReply,
    Status,
    parse_fk_reply,
    parse_info_reply,
    parse_solve_reply,
    reply_document,
)

N = 14
Q = np.linspace(-1.0, 1.0, N)
T = np.eye(4)

SOLVED = SolveReply(
    success=True,
    error="",
    status=Status.UNREACHABLE,
    id=9,
    boot_id="b",
    sol_q=Q,
    tau=2 * Q,
    position_error=np.array([0.1, 0.2]),
    rotation_error=np.array([0.3, 0.4]),
    iterations=6,
    solve_us=7.5,
    server_us=20.25,
)
REFUSED = SolveReply(success=False, error="no", status=Status.BAD_REQUEST, id=1, boot_id="b", sol_q=Q)
INFO = InfoReply(
    success=True,
    error="",
    status=Status.OK,
    boot_id="b",
    protocol=1,
    version="1.2.3",
    robot="g1",
    model_hash="ab",
    joint_names=[f"j{k}" for k in range(N)],
    lower=-Q - 2,
    upper=Q + 2,
    velocity=np.full(N, 3.0),
    shoulders=np.ones((2, 3)),
    reach=np.ones(2),
    presets=["openwbt"],
    default_preset="openwbt",
    kernel="vm",
)


def wire(codec: Codec, reply: Any) -> dict[str, Any]:
    return codec.decode(codec.encode(reply_document(reply)))


def same(a: Any, b: Any) -> bool:
    names = [field.name for field in fields(a)]
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_every_reply_survives_the_wire(codec: Codec) -> None:
    assert same(parse_solve_reply(wire(codec, SOLVED), N), SOLVED)
    assert same(parse_info_reply(wire(codec, INFO)), INFO)
    fk = FkReply(success=True, error="", status=Status.OK, id=2, boot_id="b", left_wrist=T, right_wrist=2 * T)
    assert same(parse_fk_reply(wire(codec, fk)), fk)
    refused = parse_solve_reply(wire(codec, REFUSED), N)
    assert refused.sol_q is not None
    assert np.array_equal(refused.sol_q, Q)
    assert (refused.success, refused.status, refused.error) == (False, Status.BAD_REQUEST, "no")


@pytest.mark.parametrize("reply", [SOLVED, REFUSED, INFO], ids=["solved", "refused", "info"])
def test_the_old_keys_come_first_in_their_order(reply: Any) -> None:
    assert list(wire(JSON, reply))[:3] == ["sol_q", "success", "error_msg"]


def test_a_refusal_without_q_says_null() -> None:
    blind = SolveReply(success=False, error="junk", status=Status.BAD_REQUEST)
    document = wire(JSON, blind)
    assert document["sol_q"] is None
    assert parse_solve_reply(document, N).sol_q is None


@pytest.mark.parametrize(
    "change",
    [
        {"sol_q": None},
        {"sol_q": [0.0] * 13},
        {"sol_q": [float("nan")] * N},
        {"tau": None},
        {"position_error": [0.0]},
        {"success": 1},
        {"success": False},
        {"status": "not_converged"},
        {"status": "splendid"},
        {"error_msg": None},
        {"boot_id": 3},
        {"id": "x"},
        {"solve_us": float("inf")},
        {"solve_us": float("nan")},
        {"solve_us": 10**400},
        {"iterations": True},
    ],
    ids=str,
)
def test_a_broken_reply_is_not_believed(change: dict[str, Any]) -> None:
    document = JSON.decode(JSON.encode(reply_document(SOLVED))) | change
    with pytest.raises(ReplyError, match="solve reply: "):
        parse_solve_reply(document, N)


def test_fields_of_a_newer_service_are_ignored() -> None:
    document = wire(JSON, SOLVED) | {"clearance": 0.1}
    assert same(parse_solve_reply(document, N), SOLVED)
