"""`IKClient` over Zenoh: replicas, fail-over, hung and absent services, several robots."""

import json
import threading

import numpy as np
import pytest
from fake_service import FakeService, ZenohFake

from ik_client import BadRequest, IKClient, IKError, ProtocolMismatch, ServiceTimeout, ServiceUnavailable
from ik_proto import MAX_BATCH, Status

zenoh = pytest.importorskip("zenoh")

EYE = np.eye(4)
Q = np.linspace(-0.5, 0.5, 14)


@pytest.fixture
def endpoint(free_port):
    return f"tcp/127.0.0.1:{free_port}"


@pytest.fixture
def url(free_port):
    return f"zenoh://127.0.0.1:{free_port}"


@pytest.fixture
def router(endpoint):
    config = zenoh.Config()
    for path, value in {
        "mode": "router",
        "listen/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(path, json.dumps(value))
    with zenoh.open(config):
        yield endpoint


def test_solve_fk_and_info(service, start_zenoh, endpoint, url):
    start_zenoh(service, endpoint)
    with IKClient(url, timeout=5.0) as ik:
        np.testing.assert_array_equal(ik.solve(EYE, EYE, Q).sol_q, Q + 0.1)
        np.testing.assert_array_equal(ik.fk(Q).left_wrist[:3, 3], Q[:3])
        assert ik.info().robot == "fake"
        assert ik.boot_id == service.boot_id


def test_the_largest_batch_goes_there_and_back_with_all_its_options(service, start_zenoh, endpoint, url):
    start_zenoh(service, endpoint)
    poses = np.tile(EYE, (MAX_BATCH, 1, 1))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (MAX_BATCH, 14))
    elbows = np.tile([0.0, 0.6, -0.8, 0.5], (MAX_BATCH, 1))
    options = {"waist": q[:, :3], "left_elbow": elbows, "right_elbow": elbows, "weights": np.ones((MAX_BATCH, 2, 2))}
    with IKClient(url, timeout=5.0) as ik:
        reply = ik.solve_batch(poses, poses, q, q, mode="reach", collision="avoid", starts=3, **options)
    np.testing.assert_array_equal(reply.sol_q, q + 0.1)
    request = service.requests[-1]
    for name, value in options.items():
        np.testing.assert_array_equal(getattr(request, name), value)


def test_refusals_and_mistakes_are_those_of_tcp(service, start_zenoh, endpoint, url):
    start_zenoh(service, endpoint)
    with IKClient(url, timeout=5.0) as ik:
        asked = len(service.requests)
        with pytest.raises(BadRequest, match="left_wrist must have shape 4x4"):
            ik.solve(np.eye(3), EYE, Q)
        assert len(service.requests) == asked
        service.answer = lambda request: service.refuse(request, Status.UNSUPPORTED, "no such preset")
        with pytest.raises(BadRequest, match="unsupported: no such preset"):
            ik.solve(EYE, EYE, Q)
        service.answer = lambda request: b"\x93\x01"
        with pytest.raises(ProtocolMismatch, match="not MessagePack"):
            ik.solve(EYE, EYE, Q)
        service.answer = service.reply
        assert ik.solve(EYE, EYE, Q).success


def test_nobody_there_says_what_to_start(url, free_port):
    with pytest.raises(ServiceUnavailable) as caught:
        IKClient(url, connect_timeout=0.2)
    text = str(caught.value)
    assert "\n" not in text
    assert f"ik-service serve --zenoh tcp/127.0.0.1:{free_port}" in text


def test_a_router_without_services_is_told_from_nobody(router, url):
    with pytest.raises(ServiceUnavailable, match="no service answers"):
        IKClient(url, connect_timeout=0.2)


def test_the_constructor_waits_for_a_service_that_is_just_starting(service, start_zenoh, endpoint, url):
    started = threading.Timer(0.2, lambda: start_zenoh(service, endpoint))
    started.start()
    with IKClient(url, timeout=5.0, connect_timeout=20.0) as ik:
        assert ik.solve(EYE, EYE, Q).success
    started.join()


def replicas(start_zenoh, endpoint, *names: str) -> dict[str, tuple[FakeService, ZenohFake]]:
    started = {}
    for name in names:
        service = FakeService(name)
        started[name] = (service, start_zenoh(service, endpoint, listen=False))
    return started


def count(services: dict[str, tuple[FakeService, ZenohFake]]) -> dict[str, int]:
    return {name: len(service.requests) for name, (service, _) in services.items()}


def test_a_client_stays_with_one_replica_and_each_request_is_solved_once(router, start_zenoh, url):
    services = replicas(start_zenoh, router, "a", "b", "c")
    with IKClient(url, timeout=5.0) as ik:
        for _ in range(20):
            ik.solve(EYE, EYE, Q)
    assert sorted(count(services).values()) == [0, 0, 21]


def test_a_dead_replica_is_replaced_within_the_call(router, start_zenoh, url):
    services = replicas(start_zenoh, router, "a", "b")
    with IKClient(url, timeout=5.0) as ik:
        first = ik.boot_id
        services[first][1].stop()
        assert ik.solve(EYE, EYE, Q).success
        assert ik.boot_id != first


def test_a_hung_replica_is_replaced_within_the_call_and_then_avoided(router, start_zenoh, url):
    services = replicas(start_zenoh, router, "a", "b")
    release = threading.Event()
    with IKClient(url, timeout=2.0) as ik:
        first = ik.boot_id
        hung = services[first][0]

        def hang(request):
            release.wait(60.0)
            return hung.reply(request)

        hung.answer = hang
        assert ik.solve(EYE, EYE, Q).success
        assert ik.boot_id != first
        asked = len(hung.requests)
        for _ in range(5):
            assert ik.solve(EYE, EYE, Q).success
        assert len(hung.requests) == asked
    release.set()


def test_a_hung_service_alone_is_a_timeout(service, start_zenoh, endpoint, url):
    start_zenoh(service, endpoint)
    release = threading.Event()
    with IKClient(url, timeout=5.0) as ik:

        def hang(request):
            release.wait(60.0)
            return service.reply(request)

        service.answer = hang
        ik.timeout = 0.1
        with pytest.raises(ServiceTimeout, match=r"no answer within 0\.1 s"):
            ik.solve(EYE, EYE, Q)
        release.set()
        service.answer = service.reply
        ik.timeout = 5.0
        np.testing.assert_array_equal(ik.solve(EYE, EYE, -Q).sol_q, -Q + 0.1)


def test_a_restarted_service_is_found_again(service, start_zenoh, endpoint, url):
    first = start_zenoh(service, endpoint)
    with IKClient(url, timeout=1.0) as ik:
        first.stop()
        with pytest.raises(IKError):
            ik.solve(EYE, EYE, Q)
        second = FakeService("boot-2")
        start_zenoh(second, endpoint)
        for _ in range(100):
            try:
                ik.solve(EYE, EYE, Q)
                break
            except IKError:
                threading.Event().wait(0.05)
        assert ik.boot_id == "boot-2"


def test_several_robots_are_told_apart_by_name(router, start_zenoh, url):
    start_zenoh(FakeService("a"), router, listen=False, robot="g1")
    start_zenoh(FakeService("b"), router, listen=False, robot="h1")
    with pytest.raises(ServiceUnavailable, match=r"serves several robots \(g1, h1\); name one: zenoh://.*/g1"):
        IKClient(url, connect_timeout=0.3)
    with pytest.raises(ServiceUnavailable, match="no service answers for robot r2"):
        IKClient(f"{url}/r2", connect_timeout=0.3)
    with IKClient(f"{url}/h1", timeout=5.0) as ik:
        assert ik.solve(EYE, EYE, Q).success
        assert ik.boot_id == "b"
