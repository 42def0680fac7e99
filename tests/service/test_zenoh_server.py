"""The Zenoh endpoint of a real service, asked by a bare Zenoh session."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh

from ik_proto import MAX_FRAME_BYTES, MSGPACK, SolveRequest, parse_info_reply, parse_solve_reply, request_document
from ik_service.addresses import AddressInUse
from ik_service.config import ConfigError
from ik_service.engine import Engine
from ik_service.solver import Solver
from ik_service.zenoh_server import ZenohServer, listen_locators, zenoh_config

LIMIT_S = 10.0


def open_client(locator: str) -> zenoh.Session:
    config = zenoh.Config()
    settings = {
        "mode": "client",
        "connect/endpoints": [locator],
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


@pytest.fixture(scope="module")
def session(service_process: Any) -> Iterator[zenoh.Session]:
    with open_client(service_process.ready["zenoh"]) as session:
        yield session


def ask(session: zenoh.Session, key: str, payload: bytes | None) -> list[dict[str, Any]]:
    replies = session.get(key, payload=payload, timeout=LIMIT_S)
    return [MSGPACK.decode(reply.ok.payload.to_bytes()) for reply in replies if reply.ok is not None]


def test_solve_over_the_alias_and_over_the_replicas_own_key(
    service_process: Any, session: zenoh.Session, solver: Solver, solve_request: Callable[[int], SolveRequest]
) -> None:
    for seed, key in enumerate(("ik/g1/rpc", f"ik/g1/rpc/{service_process.ready['boot_id']}")):
        request = solve_request(seed)
        (document,) = ask(session, key, MSGPACK.encode(request_document(request)))
        reply = parse_solve_reply(document, 14)
        assert (reply.id, reply.boot_id) == (request.id, service_process.ready["boot_id"])
        expected = solver.solve(request.left_wrist, request.right_wrist, request.q).q
        assert reply.sol_q is not None
        np.testing.assert_allclose(reply.sol_q, expected, atol=1e-6)


def test_fk_and_info(session: zenoh.Session, engine: Engine, solve_request: Callable[[int], SolveRequest]) -> None:
    q = solve_request(3).q
    (fk,) = ask(session, "ik/g1/rpc", MSGPACK.encode({"verb": "fk", "q": q}))
    np.testing.assert_allclose(np.frombuffer(fk["left_wrist"]).reshape(4, 4), engine.robot.fk(q)[0], atol=1e-12)
    (info,) = ask(session, "ik/g1/rpc", MSGPACK.encode({"verb": "info"}))
    assert parse_info_reply(info).joint_names == list(engine.robot.joint_names)


@pytest.mark.parametrize(
    "payload",
    [None, b"", b"junk", b"\xc1", MSGPACK.encode({"q": "x"}), b"\x00" * (MAX_FRAME_BYTES + 1), b"\x91" * 50_000],
)
def test_a_bad_payload_is_answered(session: zenoh.Session, payload: bytes | None) -> None:
    (reply,) = ask(session, "ik/g1/rpc", payload)
    assert (reply["success"], reply["status"]) == (False, "bad_request")


def test_long_work_delays_neither_other_queries_nor_the_end(
    start_service: Callable[..., Any], endless: dict[str, Any], solve_request: Callable[[int], SolveRequest]
) -> None:
    service = start_service("--tcp", "off")
    key = f"ik/g1/rpc/{service.ready['boot_id']}"
    with open_client(service.ready["zenoh"]) as session:
        replies = session.get(key, payload=MSGPACK.encode(endless), timeout=60.0)
        for seed in range(20):
            (reply,) = ask(session, key, MSGPACK.encode(request_document(solve_request(seed))))
            assert (reply["id"], reply["success"]) == (seed + 1, True)
        assert replies.try_recv() is None
        assert service.stop() == 0


def test_the_liveliness_token_lives_as_long_as_the_service(start_service: Callable[..., Any]) -> None:
    service = start_service("--tcp", "off")
    key = f"ik/g1/alive/{service.ready['boot_id']}"
    with open_client(service.ready["zenoh"]) as session:
        changes = session.liveliness().declare_subscriber("ik/g1/alive/*", history=True)
        assert _next(changes) == (key, zenoh.SampleKind.PUT)
        assert service.stop() == 0
        assert _next(changes) == (key, zenoh.SampleKind.DELETE)


def _next(subscriber: Any) -> tuple[str, zenoh.SampleKind]:
    deadline = time.monotonic() + LIMIT_S
    while time.monotonic() < deadline:
        if (sample := subscriber.try_recv()) is not None:
            return str(sample.key_expr), sample.kind
        time.sleep(0.005)
    raise TimeoutError("no liveliness change")


def test_two_replicas_behind_a_router_have_keys_of_their_own(start_service: Callable[..., Any]) -> None:
    router_config = zenoh_config("tcp/127.0.0.1:0")
    router_config.insert_json5("mode", '"router"')
    router_config.insert_json5("listen/endpoints", json.dumps(list(listen_locators(zenoh_config("tcp/127.0.0.1:0")))))
    with zenoh.open(router_config):
        (locator,) = listen_locators(router_config)
        replicas = [start_service("--tcp", "off", "--zenoh-connect", locator, "--replica") for _ in range(2)]
        with open_client(locator) as session:
            for replica in replicas:
                boot_id = replica.ready["boot_id"]
                replies = _ask_until_answered(session, f"ik/g1/rpc/{boot_id}")
                assert [reply["boot_id"] for reply in replies] == [boot_id]
            assert len(_ask_until_answered(session, "ik/g1/rpc")) == 1


def _ask_until_answered(session: zenoh.Session, key: str) -> list[dict[str, Any]]:
    deadline = time.monotonic() + LIMIT_S
    while time.monotonic() < deadline:
        if replies := ask(session, key, MSGPACK.encode({"verb": "info"})):
            return replies
        time.sleep(0.02)
    raise TimeoutError(f"nobody answers {key}")


def test_a_passed_through_configuration_wins_and_ours_fills_the_rest(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text("{ transport: { link: { tx: { lease: 5000 } } } }  // JSON5")
    config = zenoh_config("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448", str(file))
    assert json.loads(config.get_json("transport/link/tx/lease")) == 5000
    assert json.loads(config.get_json("transport/shared_memory/enabled")) is False
    assert json.loads(config.get_json("scouting/multicast/enabled")) is False
    assert listen_locators(config) == ("tcp/127.0.0.1:7447",)
    assert "7448" in config.get_json("connect/endpoints")


@pytest.mark.parametrize("text", ["{ modee: 'peer' }", "not JSON5 {"])
def test_a_wrong_configuration_is_one_line(tmp_path: Path, text: str) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        zenoh_config("tcp/127.0.0.1:7447", file=str(file))
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_address_in_use_says_so() -> None:
    config = zenoh_config("tcp/127.0.0.1:0")
    server = ZenohServer.open(config, "g1", "first")
    with pytest.raises(AddressInUse, match=r"tcp/127\.0\.0\.1:\d+ is in use"):
        ZenohServer.open(config, "g1", "second")
    assert server.stop()
