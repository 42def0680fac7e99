"""`Service`, `Dispatcher` and `IKClient` with the verb `velocity`."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from service_fakes import OPEN

from ik_client import IKClient, ServiceTimeout
from ik_proto import JSON, MSGPACK, Codec, SolveReply, Status, VelocityReply, VelocityRequest, parse_velocity_reply
from ik_proto import request_document as written
from ik_service.dispatcher import Dispatcher
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service
from ik_service.velocity import RateControl
from ik_service.velocity_kernel import VelocityLoader
from ik_service.worker import Worker

LIMIT_S = 30.0
TWIST = np.array([0.02, 0.01, -0.02, 0.1, 0.0, -0.1])


@pytest.fixture
def fresh(engine: Engine) -> Engine:
    """An engine that has not answered a `velocity` yet, in the virtual machine."""
    return replace(engine.copy(), rate_control=RateControl(VelocityLoader(engine.robot, compiled=False)))


@pytest.fixture
def worker() -> Iterator[Worker]:
    worker = Worker()
    yield worker
    assert worker.stop(LIMIT_S)


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_answer_is_the_controllers(fresh: Engine, codec: Codec) -> None:
    service, q = Service(fresh, Meter("test")), np.array(OPEN)
    waist = np.array([0.1, -0.05, 0.2])
    request = VelocityRequest(TWIST, -TWIST[:3], q, 0.1 * q, id=5, frame="hand", waist=waist, hold_left=False)
    reply = parse_velocity_reply(codec.decode(service.handle_bytes(codec.encode(written(request)), codec)), len(q))
    expected = (
        fresh.rate_control.copy()
        .get()
        .solve(TWIST, -TWIST[:3], q, 0.1 * q, frame="hand", waist=waist, hold=(False, True))
    )
    assert (reply.status, reply.id, reply.boot_id) == (Status.OK, 5, "boot-of-test")
    np.testing.assert_array_equal(reply.dq, expected.dq)
    np.testing.assert_array_equal(reply.twists, expected.twists)
    assert (reply.limited_by, reply.limiting_joint) == (expected.limited_by, expected.limiting_joint)
    assert (reply.clearance, reply.nearest) == (expected.clearance, expected.nearest)
    assert reply.server_us >= reply.solve_us > 0.0


def test_refusal_echoes_q(fresh: Engine) -> None:
    reply = Service(fresh, Meter("test")).handle({"verb": "velocity", "q": OPEN, "left_twist": [0.0] * 5, "id": 3})
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.id) == (Status.BAD_REQUEST, 3)
    assert reply.sol_q is not None
    assert "left_twist" in reply.error


def test_no_joint_is_faster_than_the_slowest_motor(fresh: Engine) -> None:
    slow = replace(fresh, about=replace(fresh.about, velocity=np.full(fresh.robot.nq, 0.25)))
    request = VelocityRequest(5.0 * TWIST, 5.0 * TWIST, np.array(OPEN), max_speed=2.0, collision="off")
    reply = Service(slow, Meter("test")).handle(written(request))
    assert isinstance(reply, VelocityReply)
    assert 0.24 < np.abs(reply.dq).max() <= 0.25 + 1e-9
    assert "speed" in reply.limited_by


def test_only_the_first_goes_to_the_worker(fresh: Engine, worker: Worker) -> None:
    """It loads the kernel; the thread that answers solves does not wait for that."""
    dispatcher = Dispatcher(Service(fresh, Meter("test")), Service(fresh.copy(), Meter("test")), worker)
    body = MSGPACK.encode(written(VelocityRequest(TWIST, TWIST, np.array(OPEN), id=1)))
    first = dispatcher.answer(body, MSGPACK)
    assert isinstance(first, Future)
    reply = parse_velocity_reply(MSGPACK.decode(first.result(LIMIT_S)), len(OPEN))
    second = dispatcher.answer(body, MSGPACK)
    assert isinstance(second, bytes)
    np.testing.assert_array_equal(parse_velocity_reply(MSGPACK.decode(second), len(OPEN)).dq, reply.dq)


def test_client_and_daemon(velocity_kernel_cache: Path, start_service: Callable[..., object]) -> None:
    """Over both transports, the same to the last bit; the first may be too late, those after it are not."""
    service = start_service()
    with IKClient(service.tcp_url, timeout=LIMIT_S) as tcp, IKClient(service.zenoh_url, timeout=LIMIT_S) as zenoh:  # ty: ignore
        q = np.array(OPEN)
        one, two = (client.velocity(TWIST, TWIST[:3], q, np.zeros(len(q))) for client in (tcp, zenoh))
        assert one.success
        assert one.dq.tobytes() == two.dq.tobytes()
        assert one.twists.shape == (2, 6)
        assert one.dq.any()
    with pytest.raises(ServiceTimeout), IKClient(service.tcp_url, timeout=1e-4, connect=False) as hasty:  # ty: ignore
        hasty.velocity(TWIST, TWIST, q)
