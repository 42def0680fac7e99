"""Every message, whatever is in it, comes out of either codec as it went in."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_proto import (
    ANSWERS,
    COLLISIONS,
    JSON,
    MODES,
    MSGPACK,
    STATUS_TABLE,
    BatchReply,
    Codec,
    FkReply,
    FkRequest,
    InfoReply,
    InfoRequest,
    SolveBatchRequest,
    SolveReply,
    SolveRequest,
    Status,
    gravest,
    parse_batch_reply,
    parse_fk_reply,
    parse_info_reply,
    parse_request,
    parse_solve_reply,
    reply_document,
    request_document,
)
from ik_proto.hints import as_elbow
from ik_proto.pose import as_pose

N, N_WAIST = 14, 3
CODECS = pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)

ids = st.integers(0, 2**53 - 1)
names = st.text(max_size=12)
finite = st.floats(-1e100, 1e100)
durations = st.floats(0.0, 1e12)


def arrays(*shape: int, bound: float = 5.0) -> st.SearchStrategy[np.ndarray]:
    return hnp.arrays(np.float64, shape, elements=st.floats(-bound, bound))


@st.composite
def poses(draw: st.DrawFn) -> np.ndarray:
    """What validation makes of a pose: such a one is not changed by another round."""
    Q, _ = np.linalg.qr(np.random.default_rng(draw(st.integers(0, 2**32))).normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Q * np.sign(np.linalg.det(Q)), draw(arrays(3))
    return as_pose(T)


@st.composite
def elbows(draw: st.DrawFn) -> np.ndarray:
    """An elbow direction with entries that floating point takes for a unit vector."""
    axis = draw(st.sampled_from([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.6, -0.8]]))
    return as_elbow(np.array([*axis, draw(st.floats(0.0, 1.0))]))


weights = hnp.arrays(np.float64, (2, 2), elements=st.floats(0.0, 1.0))
scalars = {
    "preset": st.none() | st.text(min_size=1, max_size=12),
    "id": ids,
    "mode": st.sampled_from(MODES),
    "collision": st.sampled_from([None, *COLLISIONS]),
    "starts": st.integers(1, 256),
}


def stacks(row: st.SearchStrategy[np.ndarray], count: int) -> st.SearchStrategy[np.ndarray]:
    return st.lists(row, min_size=count, max_size=count).map(np.stack)


def batches(rows: int) -> st.SearchStrategy[SolveBatchRequest]:
    return st.builds(
        SolveBatchRequest,
        left_wrist=stacks(poses(), rows),
        right_wrist=stacks(poses(), rows),
        q=arrays(rows, N),
        dq=st.none() | arrays(rows, N),
        waist=st.none() | arrays(rows, N_WAIST),
        left_elbow=st.none() | stacks(elbows(), rows),
        right_elbow=st.none() | stacks(elbows(), rows),
        weights=st.none() | stacks(weights, rows),
        **scalars,
    )


requests = st.one_of(
    st.builds(
        SolveRequest,
        left_wrist=poses(),
        right_wrist=poses(),
        q=arrays(N),
        dq=arrays(N),
        waist=st.none() | arrays(N_WAIST),
        left_elbow=st.none() | elbows(),
        right_elbow=st.none() | elbows(),
        weights=st.none() | weights,
        **scalars,
    ),
    st.integers(1, 4).flatmap(batches),
    st.builds(FkRequest, q=arrays(N), id=ids, waist=st.none() | arrays(N_WAIST)),
    st.builds(InfoRequest, id=ids),
)


def head(status: Status) -> dict[str, Any]:
    return {"success": st.just(status.success), "status": st.just(status), "error": names, "id": ids, "boot_id": names}


def solved(status: Status) -> st.SearchStrategy[SolveReply]:
    common = head(status) | {
        "sol_q": arrays(N),
        "tau": arrays(N, bound=1e3),
        "position_error": arrays(2),
        "rotation_error": arrays(2),
        "iterations": st.integers(0, 10**6),
        "solve_us": durations,
        "server_us": durations,
    }
    clearance = {"clearance": finite, "nearest": st.tuples(names, names)}
    start = {"start": st.integers(0, 256), "starts": st.integers(0, 512)}
    return st.one_of([st.builds(SolveReply, **(common | more)) for more in ({}, clearance, start, clearance | start)])


def refusals(status: Status) -> st.SearchStrategy[SolveReply]:
    return st.builds(SolveReply, **head(status), sol_q=st.none() | arrays(N))


@st.composite
def batch_replies(draw: st.DrawFn) -> BatchReply:
    rows = draw(st.integers(1, 4))
    statuses = draw(st.lists(st.sampled_from(ANSWERS), min_size=rows, max_size=rows))
    return draw(
        st.builds(
            BatchReply,
            **head(gravest(statuses)),
            sol_q=arrays(rows, N),
            statuses=st.just(statuses),
            tau=arrays(rows, N, bound=1e3),
            position_error=arrays(rows, 2),
            rotation_error=arrays(rows, 2),
            clearance=st.none() | arrays(rows),
            start=st.lists(st.integers(0, 256), min_size=rows, max_size=rows),
            iterations=st.integers(0, 10**6),
            solve_us=durations,
            server_us=durations,
        )
    )


name_lists = st.lists(names, max_size=5)
infos = st.builds(
    InfoReply,
    **head(Status.OK),
    protocol=st.integers(1, 9),
    version=names,
    robot=names,
    model_hash=names,
    joint_names=st.lists(names, min_size=N, max_size=N),
    lower=arrays(N),
    upper=arrays(N),
    velocity=arrays(N),
    shoulders=arrays(2, 3),
    reach=arrays(2),
    presets=name_lists,
    default_preset=names,
    kernel=st.sampled_from(["c", "vm"]),
    waist_joints=name_lists,
    margin=st.floats(0.0, 1.0),
    capsules=name_lists,
    modes=name_lists,
)

answered = st.sampled_from([status for status in ANSWERS if status.success]).flatmap(solved)
refused = st.sampled_from([status for status in STATUS_TABLE if not status.success]).flatmap(refusals)
fks = st.builds(FkReply, **head(Status.OK), left_wrist=arrays(4, 4), right_wrist=arrays(4, 4))


def assert_same(got: Any, sent: Any) -> None:
    """Equal fields of equal types, arrays to the last bit but for the sign of a zero."""
    assert type(got) is type(sent)
    for field in fields(sent):
        a, b = getattr(got, field.name), getattr(sent, field.name)
        if isinstance(b, np.ndarray):
            assert a.dtype == np.float64, field.name
            assert a.shape == b.shape, field.name
            assert np.array_equal(a, b), field.name
        else:
            assert type(a) is type(b), field.name
            assert a == b, field.name


@CODECS
@given(sent=requests)
def test_requests(codec: Codec, sent: Any) -> None:
    got = parse_request(codec.decode(codec.encode(request_document(sent))), N, N_WAIST)
    assert_same(got, sent)


@CODECS
@given(sent=answered | refused)
def test_solve_replies_and_refusals(codec: Codec, sent: SolveReply) -> None:
    assert_same(parse_solve_reply(codec.decode(codec.encode(reply_document(sent))), N), sent)


@CODECS
@given(sent=batch_replies())
def test_batch_replies(codec: Codec, sent: BatchReply) -> None:
    document = codec.decode(codec.encode(reply_document(sent)))
    assert_same(parse_batch_reply(document, len(sent.statuses), N), sent)


@CODECS
@given(sent=st.tuples(st.just(parse_fk_reply), fks) | st.tuples(st.just(parse_info_reply), infos))
def test_fk_and_info_replies(codec: Codec, sent: tuple[Callable[[dict[str, Any]], Any], Any]) -> None:
    parse, reply = sent
    assert_same(parse(codec.decode(codec.encode(reply_document(reply)))), reply)
