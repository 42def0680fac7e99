"""Replies: the keys an OpenWBT client reads come first, and a client of ours believes nothing unchecked."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from ik_proto import (
    JSON,
    MSGPACK,
    BatchReply,
    Codec,
    FkReply,
    InfoReply,
    ReplyError,
    SolveReply,
    Status,
    parse_batch_reply,
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
    waist_joints=["yaw", "roll"],
    margin=0.01,
    capsules=["torso", "left_hand"],
    modes=["track", "reach"],
)
BATCH = BatchReply(
    success=False,
    error="row 1 did not converge",
    status=Status.NOT_CONVERGED,
    id=3,
    boot_id="b",
    sol_q=np.stack([Q, -Q]),
    statuses=[Status.BLOCKED, Status.NOT_CONVERGED],
    tau=np.stack([2 * Q, Q]),
    position_error=np.array([[0.1, 0.2], [0.3, 0.4]]),
    rotation_error=np.array([[0.5, 0.6], [0.7, 0.8]]),
    clearance=np.array([0.01, -0.02]),
    start=[4, 0],
    iterations=12,
    solve_us=8.5,
    server_us=40.0,
)
LOOKED_AT = replace(SOLVED, clearance=-0.01, nearest=("left_hand", "torso"), start=2, starts=7)


def wire(codec: Codec, reply: Any) -> dict[str, Any]:
    return codec.decode(codec.encode(reply_document(reply)))


def same(a: Any, b: Any) -> bool:
    names = [field.name for field in fields(a)]
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_every_reply_survives_the_wire(codec: Codec) -> None:
    assert same(parse_solve_reply(wire(codec, SOLVED), N), SOLVED)
    assert same(parse_solve_reply(wire(codec, LOOKED_AT), N), LOOKED_AT)
    assert same(parse_batch_reply(wire(codec, BATCH), 2, N), BATCH)
    unmeasured = replace(BATCH, clearance=None)
    assert same(parse_batch_reply(wire(codec, unmeasured), 2, N), unmeasured)
    assert same(parse_info_reply(wire(codec, INFO)), INFO)
    fk = FkReply(success=True, error="", status=Status.OK, id=2, boot_id="b", left_wrist=T, right_wrist=2 * T)
    assert same(parse_fk_reply(wire(codec, fk)), fk)
    refused = parse_solve_reply(wire(codec, REFUSED), N)
    assert refused.sol_q is not None
    assert np.array_equal(refused.sol_q, Q)
    assert (refused.success, refused.status, refused.error) == (False, Status.BAD_REQUEST, "no")


@pytest.mark.parametrize("reply", [SOLVED, REFUSED, INFO, BATCH], ids=["solved", "refused", "info", "batch"])
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
        {"clearance": float("nan")},
        {"clearance": "far"},
        {"nearest": None},
        {"nearest": ["torso"]},
        {"nearest": ["torso", 1]},
        {"nearest": "to"},
        {"start": -1},
        {"start": 0.5},
        {"starts": None},
        {"starts": True},
    ],
    ids=str,
)
def test_a_broken_reply_is_not_believed(change: dict[str, Any]) -> None:
    document = JSON.decode(JSON.encode(reply_document(LOOKED_AT))) | change
    with pytest.raises(ReplyError, match="solve reply: "):
        parse_solve_reply(document, N)


def test_fields_of_a_newer_service_are_ignored() -> None:
    document = wire(JSON, SOLVED) | {"manipulability": 0.1}
    assert same(parse_solve_reply(document, N), SOLVED)
    document = wire(JSON, BATCH) | {"manipulability": [0.1, 0.2]}
    assert same(parse_batch_reply(document, 2, N), BATCH)


def test_what_was_not_looked_at_is_absent() -> None:
    document = wire(JSON, SOLVED)
    assert not document.keys() & {"clearance", "nearest", "start", "starts"}
    refused = wire(JSON, replace(LOOKED_AT, success=False, error="no", status=Status.NOT_CONVERGED))
    assert not refused.keys() & {"clearance", "nearest", "start", "starts", "tau"}


@pytest.mark.parametrize(
    "change",
    [
        {"sol_q": Q.tolist()},
        {"sol_q": [Q.tolist()] * 3},
        {"sol_q": None},
        {"tau": None},
        {"tau": [[float("nan")] * N] * 2},
        {"position_error": [[0.1, 0.2]]},
        {"rotation_error": [0.1, 0.2]},
        {"clearance": [0.1]},
        {"clearance": 0.1},
        {"statuses": ["ok"]},
        {"statuses": None},
        {"statuses": ["blocked", "bad_request"]},
        {"statuses": ["blocked", ["ok"]]},
        {"statuses": ["ok", "ok"]},
        {"statuses": ["not_converged", "internal"]},
        {"status": "ok", "success": True},
        {"status": "blocked", "success": True},
        {"success": True},
        {"start": [0]},
        {"start": [0, -1]},
        {"start": [0, True]},
        {"start": None},
        {"iterations": None},
        {"boot_id": None},
    ],
    ids=str,
)
def test_a_broken_batch_reply_is_not_believed(change: dict[str, Any]) -> None:
    with pytest.raises(ReplyError, match="batch reply: "):
        parse_batch_reply(wire(JSON, BATCH) | change, 2, N)


@pytest.mark.parametrize(
    "change",
    [{"waist_joints": None}, {"waist_joints": "yaw"}, {"margin": None}, {"capsules": [1]}, {"modes": None}],
    ids=str,
)
def test_a_broken_info_reply_is_not_believed(change: dict[str, Any]) -> None:
    with pytest.raises(ReplyError, match="info reply: "):
        parse_info_reply(wire(JSON, INFO) | change)
