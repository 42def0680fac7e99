"""`IKClient.solve_batch`: there and back, row by row; refusals, mistakes, faulty answers, and the time it may take."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_service import DEFAULTS, EYE, OPTIONS, Echo, Q, bent, reply_with

from ik_client import BadRequest, IKClient, ProtocolMismatch, Refused
from ik_proto import MAX_BATCH, SolveBatchRequest, Status


def rows_of(value: Any, N: int) -> Any:
    return np.stack([value] * N) if isinstance(value, np.ndarray) else value


@pytest.mark.parametrize("N", [1, 3])
def test_a_batch_goes_there_and_back(ik, service, N):
    left, right = np.stack([EYE] * N), np.stack([EYE] * N)
    left[:, 0, 3] = np.linspace(0.1, 0.3, N)
    q = np.linspace(-0.5, 0.5, 14 * N).reshape(N, 14)
    reply = ik.solve_batch(left, right, q, dq=2.0 * q, **{name: rows_of(value, N) for name, value in OPTIONS.items()})
    np.testing.assert_array_equal(reply.sol_q, q + 0.1)
    assert reply.success
    assert reply.statuses == [Status.OK] * N
    assert (reply.clearance.shape, reply.start, reply.iterations) == ((N,), [0] * N, 3 * N)
    request = service.requests[-1]
    assert isinstance(request, SolveBatchRequest)
    sent = {"left_wrist": left, "right_wrist": right, "q": q, "dq": 2.0 * q}
    for name, value in (sent | {name: rows_of(value, N) for name, value in OPTIONS.items()}).items():
        np.testing.assert_array_equal(getattr(request, name), value)
    ik.solve_batch(left.tolist(), right.tolist(), q.tolist())
    for name, default in DEFAULTS.items():
        assert getattr(service.requests[-1], name) == default
    assert service.requests[-1].dq is None


def test_the_largest_batch_goes_there_and_back(ik):
    poses = np.tile(EYE, (MAX_BATCH, 1, 1))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (MAX_BATCH, 14))
    np.testing.assert_array_equal(ik.solve_batch(poses, poses, q).sol_q, q + 0.1)
    with pytest.raises(BadRequest, match="q has 1025 rows; 1 to 1024 are accepted"):
        ik.solve_batch(poses, poses, np.zeros((MAX_BATCH + 1, 14)))


def test_a_batch_with_a_row_to_hold_is_an_answer(ik, service):
    def answer(request):
        reply = service.reply(request)
        statuses = [Status.OK, Status.NOT_CONVERGED]
        return replace(reply, success=False, error="row 1", status=Status.NOT_CONVERGED, statuses=statuses)

    service.answer = answer
    reply = ik.solve_batch([EYE, EYE], [EYE, EYE], [Q, Q])
    assert not reply.success
    assert [status.success for status in reply.statuses] == [True, False]


def test_a_refused_batch_is_raised(ik, service):
    service.answer = lambda request: service.refuse(request, Status.OVERLOADED, "full")
    with pytest.raises(Refused, match="overloaded: full"):
        ik.solve_batch([EYE], [EYE], [Q])


@pytest.mark.parametrize(
    ("left", "right", "q", "message"),
    [
        ([EYE, bent((2, 2), -1.0)], [EYE, EYE], [Q, Q], r"left_wrist\[1\] is not a pose: .*reflection"),
        ([EYE], [EYE, EYE], [Q, Q], "left_wrist must have shape 2x4x4, not 1x4x4"),
        (EYE, EYE, Q, "q must have rows of 14, even where there is only one"),
        ([EYE], [EYE], [Q[:13]], "q must have shape 1x14, not 1x13"),
        ([EYE], [EYE], [np.full(14, np.nan)], r"q\[0\] holds a number that is not finite"),
        ([], [], [], "q has 0 rows; 1 to 1024 are accepted"),
        ([EYE], [EYE], 3.0, "q must have shape"),
        ([EYE], [EYE], np.array(3.0), "q must have shape"),
        ([EYE], [EYE], "joints", "q must be an array of numbers"),
        ([EYE], [EYE], None, "q is missing"),
    ],
)
def test_a_mistaken_batch_is_found_before_it_is_sent(fake, service, left, right, q, message):
    for connect in (True, False):
        with IKClient(fake.url, timeout=2.0, connect=connect) as ik:
            asked = len(service.requests)
            with pytest.raises(BadRequest, match=message if connect else None) as caught:
                ik.solve_batch(left, right, q)
            assert "\n" not in str(caught.value)
            assert len(service.requests) == asked


@pytest.mark.parametrize(
    "changes",
    [
        {"sol_q": [[0.0] * 14]},
        {"sol_q": [[float("nan")] * 14] * 2},
        {"statuses": ["ok"]},
        {"statuses": ["ok", "blocked"]},
        {"success": False},
        {"status": "internal"},
        {"start": None},
        {"statuses": None},
    ],
    ids=str,
)
def test_a_faulty_answer_to_a_batch_is_a_mismatch(ik, service, changes):
    service.answer = lambda request: reply_with(service.reply(request), **changes)
    with pytest.raises(ProtocolMismatch):
        ik.solve_batch([EYE, EYE], [EYE, EYE], [Q, Q])


def test_a_batch_may_take_longer_by_its_rows():
    deadlines = []

    class Recorder(Echo):
        def request(self, body: bytes, deadline: float) -> bytes:
            deadlines.append(deadline)
            return super().request(body, deadline)

    ik = IKClient("tcp://127.0.0.1:1", timeout=0.1, connect=False, clock=lambda: 5.0)
    ik._transport = Recorder(b"junk")
    for N in (1, 50, MAX_BATCH):
        poses = np.stack([EYE] * N)
        with pytest.raises(ProtocolMismatch):
            ik.solve_batch(poses, poses, np.stack([Q] * N))
    with pytest.raises(ProtocolMismatch):
        ik.solve(EYE, EYE, Q)
    np.testing.assert_allclose(deadlines, [5.102, 5.2, 5.1 + 2.048, 5.1])
