"""`Service`: every verb, every status, and answers that are those of the solver and of Pinocchio."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from service_fakes import OPEN, StubSolver, batch_of, service_with

from ik_proto import (
    JSON,
    MSGPACK,
    Codec,
    Collision,
    FkReply,
    InfoReply,
    SolveReply,
    SolveRequest,
    Status,
    parse_fk_reply,
    parse_info_reply,
    parse_solve_reply,
    request_document,
)
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service
from ik_service.solver import Solver


@pytest.fixture
def meter() -> Meter:
    return Meter("test")


@pytest.fixture
def service(engine: Engine, meter: Meter) -> Service:
    return Service(engine.copy(), meter)


def test_solve_answers_what_the_solver_finds(
    service: Service, solver: Solver, solve_request: Callable[[int], SolveRequest]
) -> None:
    for seed in range(20):
        request = solve_request(seed)
        reply = service.handle(request_document(request))
        expected = solver.solve(request.left_wrist, request.right_wrist, request.q)
        assert isinstance(reply, SolveReply)
        assert (reply.success, reply.status, reply.error, reply.id) == (True, Status.OK, "", seed + 1)
        assert reply.boot_id == "boot-of-test"
        np.testing.assert_array_equal(reply.sol_q, expected.q)
        np.testing.assert_array_equal(reply.tau, expected.tau)
        np.testing.assert_array_equal(reply.position_error, expected.position_error)
        assert (reply.clearance, reply.nearest) == (expected.clearance, expected.nearest)
        assert (reply.start, reply.starts) == (0, 1)


OPTIONS = {
    "mode": "reach",
    "waist": [0.1, 0.2, 0.3],
    "left_elbow": [0.0, 0.0, -1.0, 0.5],
    "right_elbow": [0.0, -1.0, 0.0, 1.0],
    "weights": [[1.0, 0.0], [0.5, 1.0]],
    "collision": "off",
    "starts": 7,
}


def plain(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in options.items()}


def test_every_option_reaches_the_solver(engine: Engine, document: Callable[..., dict[str, Any]]) -> None:
    stub = StubSolver(Status.OK)
    service = Service(replace(engine, solvers={"precise": stub}), Meter("test"))
    assert service.handle(document(**OPTIONS)).success
    assert {
        name: value.tolist() if hasattr(value, "tolist") else value for name, value in stub.asked.items()
    } == OPTIONS
    assert service.handle({**batch_of([document(**OPTIONS)] * 2), "verb": "solve_batch"}).success
    rows = {name: [value] * 2 if isinstance(value, list) else value for name, value in OPTIONS.items()}
    assert plain(stub.asked) == rows


@pytest.mark.parametrize("collision", ["off", "report", "avoid"])
def test_a_request_that_does_not_say_gets_the_services_setting(
    engine: Engine, document: Callable[..., dict[str, Any]], collision: Collision
) -> None:
    stub = StubSolver(Status.OK)
    service = Service(replace(engine, solvers={"precise": stub}, collision=collision), Meter("test"))
    service.handle(document())
    assert stub.asked["collision"] == collision
    service.handle(document(collision="report"))
    assert stub.asked["collision"] == "report"


def test_clearance_is_said_where_it_is_measured(
    engine: Engine, service: Service, document: Callable[..., dict[str, Any]]
) -> None:
    off = json.loads(service.handle_bytes(json.dumps(document(collision="off")).encode(), JSON))
    assert off["success"]
    assert not {"clearance", "nearest"} & off.keys()
    assert (off["start"], off["starts"]) == (0, 1)
    report = json.loads(service.handle_bytes(json.dumps(document(collision="report")).encode(), JSON))
    names = {capsule.name for capsule in engine.robot.collision.capsules}
    assert set(report["nearest"]) < names
    assert report["clearance"] > engine.robot.collision.margin
    assert report["sol_q"] == off["sol_q"]


def test_a_target_inside_the_body_is_blocked_and_may_be_followed(
    engine: Engine, service: Service, document: Callable[..., dict[str, Any]]
) -> None:
    inside = np.eye(4)
    inside[:3, 3] = [0.05, 0.0, 0.15]
    request = document(left_wrist=inside.tolist(), q=OPEN, dq=[0.0] * 14)
    reply = service.handle(request)
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.success, reply.error) == (Status.BLOCKED, True, "")
    assert reply.clearance is not None
    assert reply.clearance >= engine.robot.collision.margin
    through = service.handle({**request, "collision": "report"})  # what it was kept from
    assert isinstance(through, SolveReply)
    assert through.clearance is not None
    assert through.clearance < 0.0


def test_the_waist_carries_the_shoulders(
    engine: Engine, service: Service, document: Callable[..., dict[str, Any]]
) -> None:
    q, waist = OPEN, [0.3, -0.1, 0.2]
    reply = service.handle({"verb": "fk", "q": q, "waist": waist})
    assert isinstance(reply, FkReply)
    left, right = engine.robot.fk(np.array(q), np.array(waist))
    np.testing.assert_array_equal([reply.left_wrist, reply.right_wrist], [left, right])
    solved = service.handle(
        document(left_wrist=left.tolist(), right_wrist=right.tolist(), q=q, dq=[0.0] * 14, waist=waist)
    )
    assert isinstance(solved, SolveReply)
    assert solved.status is Status.OK
    assert solved.position_error is not None
    assert solved.position_error.max() < 1e-4
    straight = service.handle({"verb": "fk", "q": solved.sol_q})
    assert isinstance(straight, FkReply)
    assert np.linalg.norm(straight.left_wrist[:3, 3] - left[:3, 3]) > 0.03


@pytest.mark.parametrize("hint", ["left_elbow", "right_elbow"])
def test_a_robot_without_elbows_takes_no_elbow_hints(
    engine: Engine, document: Callable[..., dict[str, Any]], hint: str
) -> None:
    robot = engine.robot.copy()
    left, right = robot.arms
    robot.arms = (replace(left, elbow=None), replace(right, elbow=None))
    service = Service(replace(engine, robot=robot), Meter("test"))
    request = document(3, **{hint: [0.0, 0.0, -1.0, 1.0]})
    reply = service.handle(request)
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.id) == (Status.UNSUPPORTED, 4)
    assert reply.error == f"{hint} cannot be served: no elbow is named for robot g1"
    np.testing.assert_array_equal(reply.sol_q, request["q"])
    batch = service.handle(batch_of([request]))
    assert (batch.status, batch.error) == (Status.UNSUPPORTED, reply.error)


def test_residuals_are_those_of_the_returned_joints(
    engine: Engine, service: Service, solve_request: Callable[[int], SolveRequest]
) -> None:
    request = solve_request(3)
    reply = service.handle(request_document(request))
    assert isinstance(reply, SolveReply)
    assert reply.sol_q is not None
    assert reply.position_error is not None
    left, right = engine.robot.fk(reply.sol_q)
    distances = [np.linalg.norm(left[:3, 3] - request.left_wrist[:3, 3])]
    distances.append(np.linalg.norm(right[:3, 3] - request.right_wrist[:3, 3]))
    np.testing.assert_allclose(reply.position_error, distances, atol=1e-12)


def test_out_of_reach_is_followed_and_said(service: Service, document: Callable[..., dict[str, Any]]) -> None:
    """Hazard row: unreachable."""
    far = np.eye(4)
    far[0, 3] = 2.0
    reply = service.handle(document(left_wrist=far.tolist(), collision="off"))
    assert isinstance(reply, SolveReply)
    assert reply.status is Status.UNREACHABLE
    assert reply.success
    assert reply.position_error is not None
    assert reply.position_error[0] > 1.0


def test_fk_is_pinocchios(engine: Engine, service: Service, solve_request: Callable[[int], SolveRequest]) -> None:
    q = solve_request(5).q
    reply = service.handle({"verb": "fk", "q": q.tolist(), "id": 9})
    left, right = engine.robot.fk(q)
    assert isinstance(reply, FkReply)
    assert reply.id == 9
    np.testing.assert_array_equal(reply.left_wrist, left)
    np.testing.assert_array_equal(reply.right_wrist, right)


def test_info_says_who_answers(engine: Engine, service: Service) -> None:
    reply = service.handle({"verb": "info", "id": 4})
    assert isinstance(reply, InfoReply)
    assert (reply.id, reply.boot_id, reply.version, reply.robot) == (4, "boot-of-test", "0.0.test", engine.robot.name)
    assert reply.joint_names == list(engine.robot.joint_names)
    np.testing.assert_array_equal(reply.lower, engine.robot.lower)
    assert reply.shoulders.shape == (2, 3)
    assert (reply.reach > 0.3).all()
    assert reply.default_preset in reply.presets
    assert reply.default_preset == "precise"
    assert reply.kernel == "vm"
    assert reply.waist_joints == ["waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"]
    assert reply.margin == 0.010
    assert reply.capsules == [capsule.name for capsule in engine.robot.collision.capsules]
    assert reply.modes == ["track", "reach"]


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_every_verb_survives_the_wire(
    codec: Codec, service: Service, solve_request: Callable[[int], SolveRequest], engine: Engine
) -> None:
    request = solve_request(1)
    n = engine.robot.nq
    solved = parse_solve_reply(codec.decode(service.handle_bytes(codec.encode(request_document(request)), codec)), n)
    assert solved.status is Status.OK
    fk = parse_fk_reply(codec.decode(service.handle_bytes(codec.encode({"verb": "fk", "q": solved.sol_q}), codec)))
    np.testing.assert_allclose(fk.left_wrist, request.left_wrist, atol=0.05)
    info = parse_info_reply(codec.decode(service.handle_bytes(codec.encode({"verb": "info"}), codec)))
    assert len(info.joint_names) == n


@pytest.mark.parametrize(
    ("changes", "status", "words"),
    [
        ({"left_wrist": np.full((4, 4), math.nan).tolist()}, Status.BAD_REQUEST, "left_wrist"),
        ({"left_wrist": np.eye(3).tolist()}, Status.BAD_REQUEST, "4x4"),
        ({"right_wrist": np.diag([1.0, 1.0, -1.0, 1.0]).tolist()}, Status.BAD_REQUEST, "reflection"),
        ({"q": [0.0] * 13}, Status.BAD_REQUEST, "14"),
        ({"q": [math.inf] * 14}, Status.BAD_REQUEST, "q"),
        ({"q": None}, Status.BAD_REQUEST, "q is missing"),
        ({"speling": 1}, Status.BAD_REQUEST, "speling"),
        ({"verb": "dance"}, Status.UNSUPPORTED, "dance"),
        ({"v": 99}, Status.UNSUPPORTED, "99"),
        ({"preset": "fancy"}, Status.UNSUPPORTED, "openwbt"),
    ],
)
def test_a_wrong_request_gets_its_status_and_one_line(
    service: Service, document: Callable[..., dict[str, Any]], changes: dict[str, Any], status: Status, words: str
) -> None:
    """Hazard rows: NaN / Inf; non-orthonormal / reflected; malformed frame."""
    reply = service.handle(document(7, **changes))
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.success, reply.id) == (status, False, 8)
    assert words in reply.error
    assert "\n" not in reply.error
    if "q" not in changes:
        np.testing.assert_array_equal(reply.sol_q, document(7)["q"])


def test_not_converged_echoes_q_and_gives_nothing_to_follow(
    engine: Engine, solve_request: Callable[[int], SolveRequest]
) -> None:
    """Hazard row: solver failure."""
    request = solve_request(2)
    reply = service_with(engine, Status.NOT_CONVERGED).handle(request_document(request))
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.success) == (Status.NOT_CONVERGED, False)
    assert reply.error
    assert reply.tau is None
    assert (reply.clearance, reply.nearest, reply.start, reply.starts) == (None, None, None, None)
    np.testing.assert_array_equal(reply.sol_q, request.q)


def test_a_fault_of_ours_is_plain_on_the_wire_and_full_in_the_log(
    engine: Engine, document: Callable[..., dict[str, Any]], caplog: pytest.LogCaptureFixture
) -> None:
    meter = Meter("test")
    service = service_with(engine, RuntimeError("secret /path/of/file.py"), meter)
    reply = json.loads(service.handle_bytes(json.dumps(document(6)).encode(), JSON))
    assert (reply["status"], reply["success"], reply["id"]) == ("internal", False, 7)
    assert reply["sol_q"] == document(6)["q"]
    assert "secret" not in json.dumps(reply)
    assert "Traceback" not in json.dumps(reply)
    assert meter.outcomes[Status.INTERNAL] == 1
    assert "secret /path/of/file.py" in caplog.text


def test_durations_come_from_the_injected_clock(engine: Engine, document: Callable[..., dict[str, Any]]) -> None:
    ticks = iter(range(100))
    meter = Meter("test")
    service = service_with(engine, Status.OK, meter, clock=lambda: float(next(ticks)))
    reply = json.loads(service.handle_bytes(json.dumps(document()).encode(), JSON))
    assert reply["solve_us"] == 1e6
    assert reply["server_us"] == 2e6
    assert meter.solves.total == pytest.approx(1.0)
    assert meter.requests.total == 3.0


def test_nothing_is_remembered_between_requests(service: Service, document: Callable[..., dict[str, Any]]) -> None:
    first = service.handle(document(0))
    service.handle(document(1, left_wrist=np.diag([1.0, 1.0, -1.0, 1.0]).tolist()))
    service.handle(document(2))
    again = service.handle(document(0))
    assert isinstance(first, SolveReply)
    assert isinstance(again, SolveReply)
    np.testing.assert_array_equal(first.sol_q, again.sol_q)


@given(body=st.binary(max_size=200))
def test_any_bytes_get_exactly_one_reply(engine: Engine, body: bytes) -> None:
    """Hazard row: malformed frame."""
    service = Service(engine, Meter("test"))
    for codec in (JSON, MSGPACK):
        reply = codec.decode(service.handle_bytes(body, codec))
        assert reply["success"] is False
        assert reply["status"] in ("bad_request", "unsupported")


@given(
    changes=st.dictionaries(
        st.sampled_from(["left_wrist", "right_wrist", "q", "dq", "id", "v", "verb", "preset", "other"]),
        st.recursive(
            st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
            lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
            max_leaves=8,
        ),
        min_size=1,
    )
)
def test_any_field_may_be_anything(
    engine: Engine, document: Callable[..., dict[str, Any]], changes: dict[str, Any]
) -> None:
    reply = Service(engine, Meter("test")).handle({**document(), **changes})
    assert reply.status is not Status.INTERNAL
    assert "\n" not in reply.error
