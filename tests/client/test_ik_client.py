"""`IKClient` over TCP: answers, refusals, time limits, broken connections, return of the service."""

import json
import socket
import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_service import EYE, Echo, FakeService, Q, bent, reply_with
from hypothesis import given
from hypothesis import strategies as st

from ik_client import BadRequest, IKClient, IKError, ProtocolMismatch, Refused, ServiceTimeout, ServiceUnavailable
from ik_proto import JSON, SolveReply, SolveRequest, Status, encode_frame, reply_document

SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400)
JUNK = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=15))


def test_solve_fk_and_info_return_objects(ik, service):
    reply = ik.solve(EYE, EYE, Q)
    np.testing.assert_array_equal(reply.sol_q, Q + 0.1)
    assert (reply.success, reply.error, reply.status, reply.solve_us) == (True, "", Status.OK, 7.0)
    np.testing.assert_array_equal(reply.tau, np.ones(14))
    np.testing.assert_array_equal(ik.fk(Q).right_wrist[:3, 3], Q[7:10])
    assert ik.info().robot == "fake"
    assert ik.boot_id == service.boot_id


def test_what_is_asked_reaches_the_service_unchanged(fake, service):
    left, right = EYE.copy(), EYE.copy()
    left[:3, 3], right[:3, 3] = [0.3, 0.1, 0.2], [0.3, -0.1, 1.0 / 3.0]
    with IKClient(fake.url, timeout=2.0, preset="openwbt") as ik:
        ik.solve(left, right, Q, dq=2.0 * Q)
    request = service.requests[-1]
    assert isinstance(request, SolveRequest)
    assert request.preset == "openwbt"
    for sent, got in ((left, request.left_wrist), (right, request.right_wrist), (Q, request.q), (2.0 * Q, request.dq)):
        np.testing.assert_array_equal(sent, got)


def test_lists_are_taken_like_arrays_and_dq_defaults_to_zero(ik, service):
    ik.solve(EYE.tolist(), EYE.tolist(), Q.tolist())
    np.testing.assert_array_equal(service.requests[-1].dq, np.zeros(14))


@pytest.mark.parametrize("status", [Status.UNREACHABLE, Status.NOT_CONVERGED])
def test_an_answer_is_returned_whatever_its_status(ik, service, status):
    def answer(request):
        reply = service.reply(request)
        return SolveReply(
            success=status.success,
            error="" if status.success else "stopped early",
            status=status,
            id=request.id,
            boot_id="b",
            sol_q=request.q,
            tau=reply.tau,
            position_error=np.array([0.1, 0.2]),
            rotation_error=np.zeros(2),
        )

    service.answer = answer
    reply = ik.solve(EYE, EYE, Q)
    assert reply.status is status
    assert reply.success is status.success
    np.testing.assert_array_equal(reply.sol_q, Q)


@pytest.mark.parametrize(
    ("status", "error"),
    [
        (Status.BAD_REQUEST, BadRequest),
        (Status.UNSUPPORTED, BadRequest),
        (Status.OVERLOADED, Refused),
        (Status.INTERNAL, Refused),
    ],
)
def test_a_refusal_is_raised_with_its_status_and_reply(ik, service, status, error):
    service.answer = lambda request: service.refuse(request, status, "because")
    for call in (lambda: ik.solve(EYE, EYE, Q), lambda: ik.fk(Q), ik.info):
        with pytest.raises(error, match="because") as caught:
            call()
        assert type(caught.value) is error
        assert caught.value.status is status
        assert caught.value.reply.error == "because"
    service.answer = service.reply
    assert ik.solve(EYE, EYE, Q).success


def test_a_refusal_without_id_is_a_refusal(ik, service):
    service.answer = lambda request: SolveReply(
        success=False, error="full", status=Status.OVERLOADED, id=0, boot_id="b"
    )
    with pytest.raises(Refused, match="overloaded: full"):
        ik.solve(EYE, EYE, Q)


@pytest.mark.parametrize(
    ("left", "q", "dq", "message"),
    [
        (np.eye(3), Q, Q, "left_wrist must have shape 4x4"),
        (bent((0, 3), np.nan), Q, Q, "left_wrist"),
        (bent((0, 3), np.inf), Q, Q, "left_wrist"),
        (bent((2, 2), -1.0), Q, Q, "reflection"),
        (bent((0, 1), 0.5), Q, Q, "not a rotation"),
        (None, Q, Q, "left_wrist is missing"),
        (EYE, Q[:13], Q, "q must have shape 14, not 13"),
        (EYE, np.where(Q > 0, np.nan, Q), Q, "q holds a number that is not finite"),
        (EYE, Q, Q[:2], "dq must have shape 14, not 2"),
        (EYE, "joints", Q, "q must be an array of numbers"),
        (EYE, 3.0, Q, "q must have shape 14"),
        (EYE, [[1.0], [1.0, 2.0]], Q, "q must be an array"),
    ],
)
def test_a_mistake_is_found_before_it_is_sent(ik, service, left, q, dq, message):
    asked = len(service.requests)
    with pytest.raises(BadRequest, match=message) as caught:
        ik.solve(left, EYE, q, dq)
    assert "\n" not in str(caught.value)
    assert caught.value.reply is None
    assert len(service.requests) == asked


def test_without_connecting_first_the_number_of_joints_is_the_callers(fake, service):
    no_vector: Any = 3.0
    with IKClient(fake.url, timeout=2.0, connect=False) as ik:
        assert fake.accepted == 0
        with pytest.raises(BadRequest, match="13") as caught:
            ik.solve(EYE, EYE, Q[:13])
        assert caught.value.reply is not None
        with pytest.raises(BadRequest, match="q must"):
            ik.solve(EYE, EYE, no_vector)


def test_nobody_there_is_one_line_that_says_what_to_start(free_port):
    began = time.monotonic()
    with pytest.raises(ServiceUnavailable) as caught:
        IKClient(f"tcp://127.0.0.1:{free_port}", connect_timeout=0.2)
    assert time.monotonic() - began < 2.0  # it gives up; the limit only tells that from waiting for ever
    text = str(caught.value)
    assert "\n" not in text
    assert f"tcp://127.0.0.1:{free_port}: nobody is there (connection refused)" in text
    assert f"ik-service serve --tcp 127.0.0.1:{free_port}" in text


def test_the_constructor_waits_for_a_service_that_is_just_starting(service, start_tcp, free_port):
    started = threading.Timer(0.2, lambda: start_tcp(service, free_port))
    started.start()
    with IKClient(f"tcp://127.0.0.1:{free_port}", timeout=2.0, connect_timeout=10.0) as ik:
        assert ik.solve(EYE, EYE, Q).success
    started.join()


def test_a_refused_connection_costs_no_waiting_and_no_pause(free_port, service, start_tcp):
    ik = IKClient(f"tcp://127.0.0.1:{free_port}", timeout=30.0, connect=False)
    for _ in range(5):
        with pytest.raises(ServiceUnavailable):  # at once: the test's own limit is far below the sum of timeouts
            ik.solve(EYE, EYE, Q)
    start_tcp(service, free_port)
    assert ik.solve(EYE, EYE, Q).success  # the very next call
    ik.close()


def test_a_late_reply_never_answers_the_next_request(fake, service):
    release, first = threading.Event(), threading.Event()

    def answer(request):
        if not first.is_set():
            first.set()
            release.wait(10.0)
        return service.reply(request)

    with IKClient(fake.url, timeout=0.2) as ik:
        service.answer = answer
        with pytest.raises(ServiceTimeout, match=r"no answer within 0\.2 s") as caught:
            ik.solve(EYE, EYE, Q)
        assert caught.value.timeout == 0.2
        release.set()
        ik.timeout = 5.0
        np.testing.assert_array_equal(ik.solve(EYE, EYE, -Q).sol_q, -Q + 0.1)


def test_a_reply_to_another_request_is_refused_and_the_connection_dropped(ik, fake, service):
    def answer(request):
        return reply_with(service.reply(request), id=request.id + 1)

    service.answer = answer
    with pytest.raises(ProtocolMismatch, match=r"reply \d+ came for request \d+"):
        ik.solve(EYE, EYE, Q)
    service.answer = service.reply
    before = fake.accepted
    assert ik.solve(EYE, EYE, Q).success
    assert fake.accepted == before + 1


@pytest.mark.parametrize(
    "said",
    [
        b"",
        b"HTTP/1.1 400 Bad Request",
        b"[]",
        b"null",
        b'{"sol_q": null, "success": false, "error_msg": ""}',  # OpenWBT's own server
        b'{"success": true}',
        b'{"success": false, "status": ["ok"], "error_msg": "", "boot_id": ""}',
        b'{"success": 1, "status": "ok", "error_msg": "", "boot_id": ""}',
    ],
)
def test_what_is_no_reply_is_a_mismatch_in_one_line(ik, service, said):
    service.answer = lambda request: said
    with pytest.raises(ProtocolMismatch) as caught:
        ik.solve(EYE, EYE, Q)
    assert "\n" not in str(caught.value)
    service.answer = service.reply
    assert ik.solve(EYE, EYE, Q).success


@pytest.mark.parametrize(
    "changes",
    [
        {"sol_q": [0.0] * 13},
        {"sol_q": [float("nan")] * 14},
        {"sol_q": None},
        {"tau": None},
        {"status": "splendid"},
        {"success": False},
        {"position_error": [1.0]},
        {"solve_us": "fast"},
    ],
)
def test_a_faulty_answer_is_a_mismatch(ik, service, changes):
    service.answer = lambda request: reply_with(service.reply(request), **changes)
    with pytest.raises(ProtocolMismatch):
        ik.solve(EYE, EYE, Q)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (lambda body: 2 * encode_frame(body), "more than one reply"),
        (lambda body: encode_frame(body) + b"\0", "more than one reply"),
        (lambda body: b"\xff\xff\xff\xff" + body, "frame of 4294967295 bytes"),
    ],
)
def test_a_stream_out_of_step_is_dropped(fake, service, frame, message):
    with IKClient(fake.url, timeout=2.0) as ik:
        service.frame = frame
        with pytest.raises(ProtocolMismatch, match=message):
            ik.solve(EYE, EYE, Q)
        service.frame = encode_frame
        assert ik.solve(EYE, EYE, Q).success


def test_a_reply_may_come_in_pieces(fake, service):
    service.frame = lambda body: encode_frame(body + b" " * 60_000)  # more than one segment
    with IKClient(fake.url, timeout=5.0) as ik:
        assert ik.solve(EYE, EYE, Q).success


def answer_to(said: bytes) -> SolveReply | IKError:
    ik = IKClient("tcp://127.0.0.1:1", connect=False)
    ik._transport = Echo(said)
    try:
        return ik.solve(EYE, EYE, Q)
    except IKError as error:
        return error


@given(st.binary(max_size=60))
def test_junk_instead_of_a_reply_is_a_mismatch(said):
    assert isinstance(answer_to(said), ProtocolMismatch)


@given(st.data())
def test_a_reply_with_one_field_of_junk_is_an_answer_or_one_of_our_errors(data):
    reply = json.loads(JSON.encode(reply_document(FakeService().reply(SolveRequest(EYE, EYE, Q, Q, id=1)))))
    reply[data.draw(st.sampled_from(sorted(reply)))] = data.draw(JUNK)
    answer = answer_to(json.dumps(reply).encode())
    if isinstance(answer, SolveReply):
        assert np.isfinite(np.asarray(answer.sol_q)).all()
    else:
        assert "\n" not in str(answer)


def test_a_server_of_another_version_is_a_mismatch(service, start_tcp):
    service.answer = lambda request: replace(service.reply(request), protocol=2)
    with pytest.raises(ProtocolMismatch, match="serves version 2, this client speaks version 1"):
        IKClient(start_tcp(service).url, timeout=2.0)


def test_a_restart_between_two_calls_shows_in_boot_id_alone(service, start_tcp):
    """Hazard row: service restart."""
    first = start_tcp(service)
    with IKClient(first.url, timeout=2.0) as ik:
        ik.solve(EYE, EYE, Q)
        first.stop()
        service.boot_id = "boot-2"
        start_tcp(service, first.port)
        assert ik.solve(EYE, EYE, Q).success
        assert ik.boot_id == "boot-2"


def test_a_service_that_dies_during_a_call_is_unavailable_at_once(fake, service):
    """Hazard row: lost connection."""
    with IKClient(fake.url, timeout=30.0) as ik:
        service.answer = lambda request: None
        with pytest.raises(ServiceUnavailable, match="closes the connection without an answer"):
            ik.solve(EYE, EYE, Q)
        service.answer = service.reply
        assert ik.solve(EYE, EYE, Q).success  # a single failure does not pause


def test_a_silent_host_costs_its_timeout_now_and_then_not_every_call(free_port):
    """Hazard row: lost connection."""
    now = [0.0]

    def clock() -> float:
        now[0] += 1e-3
        return now[0]

    with socket.create_server(("127.0.0.1", free_port)):  # accepts in the kernel, never reads
        ik = IKClient(f"tcp://127.0.0.1:{free_port}", timeout=0.05, connect=False, clock=clock)
        outcomes = []
        for _ in range(40):
            try:
                ik.solve(EYE, EYE, Q)
            except IKError as error:
                outcomes.append(type(error))
    assert outcomes[:2] == [ServiceTimeout, ServiceTimeout]
    assert outcomes.count(ServiceTimeout) <= 8
    assert outcomes.count(ServiceUnavailable) == 40 - outcomes.count(ServiceTimeout)


def test_after_close_it_says_so(fake):
    ik = IKClient(fake.url, timeout=2.0)
    ik.close()
    ik.close()
    with pytest.raises(ServiceUnavailable, match="closed"):
        ik.solve(EYE, EYE, Q)


def test_an_unknown_host_is_one_line():
    with pytest.raises(ServiceUnavailable, match=r"host no-such-host\.invalid is not known") as caught:
        IKClient("tcp://no-such-host.invalid:1", connect_timeout=10.0)
    assert "\n" not in str(caught.value)


def test_localhost_is_looked_up(fake):
    with IKClient(f"tcp://localhost:{fake.port}", timeout=2.0) as ik:
        assert ik.solve(EYE, EYE, Q).success


@pytest.mark.parametrize("arguments", [{"timeout": 0.0}, {"timeout": float("nan")}, {"connect_timeout": float("inf")}])
def test_time_limits_are_finite_and_positive(arguments):
    with pytest.raises(ValueError, match="positive number of seconds"):
        IKClient("tcp://127.0.0.1:1", **arguments)
