"""`Service`, `Dispatcher` and `IKClient` with the verb `velocity`."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

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
from ik_service.worker import Worker

LIMIT_S = 30.0
TWIST = np.array([0.02, 0.01, -0.02, 0.1, 0.0, -0.1])


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_answer_is_the_controllers(engine: Engine, codec: Codec) -> None:
    service, q = Service(engine, Meter("test")), np.array(OPEN)
    waist = np.array([0.1, -0.05, 0.2])
    request = VelocityRequest(TWIST, -TWIST[:3], q, 0.1 * q, id=5, frame="hand", waist=waist, hold_left=False)
    reply = parse_velocity_reply(codec.decode(service.handle_bytes(codec.encode(written(request)), codec)), len(q))
    control = engine.copy().rate_control
    expected = control.solve(TWIST, -TWIST[:3], q, 0.1 * q, frame="hand", waist=waist, hold=(False, True))
    assert (reply.status, reply.id, reply.boot_id) == (Status.OK, 5, "boot-of-test")
    np.testing.assert_array_equal(reply.dq, expected.dq)
    np.testing.assert_array_equal(reply.twists, expected.twists)
    assert (reply.limited_by, reply.limiting_joint) == (expected.limited_by, expected.limiting_joint)
    assert (reply.clearance, reply.nearest) == (expected.clearance, expected.nearest)
    assert reply.server_us >= reply.solve_us > 0.0


def test_refusal_echoes_q(engine: Engine) -> None:
    reply = Service(engine, Meter("test")).handle({"verb": "velocity", "q": OPEN, "left_twist": [0.0] * 5, "id": 3})
    assert isinstance(reply, SolveReply)
    assert (reply.status, reply.id) == (Status.BAD_REQUEST, 3)
    assert reply.sol_q is not None
    assert "left_twist" in reply.error


def test_no_joint_is_faster_than_the_slowest_motor(engine: Engine) -> None:
    slow = replace(engine, about=replace(engine.about, velocity=np.full(engine.robot.nq, 0.25)))
    request = VelocityRequest(5.0 * TWIST, 5.0 * TWIST, np.array(OPEN), max_speed=2.0, collision="off")
    reply = Service(slow, Meter("test")).handle(written(request))
    assert isinstance(reply, VelocityReply)
    assert 0.24 < np.abs(reply.dq).max() <= 0.25 + 1e-9
    assert "speed" in reply.limited_by


def test_the_first_is_answered_at_once(engine: Engine) -> None:
    """As every solve, by the thread that it came to: nothing is left to be loaded."""
    dispatcher = Dispatcher(Service(engine, Meter("test")), Service(engine.copy(), Meter("test")), Worker())
    body = MSGPACK.encode(written(VelocityRequest(TWIST, TWIST, np.array(OPEN), id=1)))
    first = dispatcher.answer(body, MSGPACK)
    assert isinstance(first, bytes)
    assert parse_velocity_reply(MSGPACK.decode(first), len(OPEN)).dq.any()


def test_client_and_daemon(start_service: Callable[..., Any]) -> None:
    """Over both transports, the same to the last bit."""
    service = start_service()
    with IKClient(service.tcp_url, timeout=LIMIT_S) as tcp, IKClient(service.zenoh_url, timeout=LIMIT_S) as zenoh:
        q = np.array(OPEN)
        one, two = (client.velocity(TWIST, TWIST[:3], q, np.zeros(len(q))) for client in (tcp, zenoh))
        assert one.success
        assert one.dq.tobytes() == two.dq.tobytes()
        assert one.twists.shape == (2, 6)
        assert one.dq.any()
    with pytest.raises(ServiceTimeout), IKClient(service.tcp_url, timeout=1e-4, connect=False) as hasty:
        hasty.velocity(TWIST, TWIST, q)
