"""Two services of one robot on one Zenoh network: the second one is told, unless it is meant.

Hazard row: duplicate services.
"""

import json
import threading
from collections.abc import Generator, Iterator
from contextlib import contextmanager

import pytest
import zenoh

from ik_service.zenoh_server import DuplicateService, ZenohServer, listen_locators, zenoh_config

LIMIT_S = 10.0


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    """Locator of a router."""
    config = zenoh_config("tcp/127.0.0.1:0")
    config.insert_json5("mode", '"router"')
    (locator,) = listen_locators(config)
    with zenoh.open(config):
        yield locator


@contextmanager
def alive(config: zenoh.Config, boot_id: str) -> Generator[zenoh.LivelinessToken]:
    """Look like a service."""
    with zenoh.open(config) as session:
        token = session.liveliness().declare_token(f"ik/g1/alive/{boot_id}")  # withdrawn when nobody holds it
        yield token


def test_a_second_service_of_a_robot_is_refused(router: str) -> None:
    """Hazard row: duplicate services."""
    with alive(zenoh_config("tcp/127.0.0.1:0", router), "first"):
        with pytest.raises(DuplicateService) as caught:
            ZenohServer.open(zenoh_config("tcp/127.0.0.1:0", router), "g1", "second", patience_s=0.0)
        assert (caught.value.robot, caught.value.boot_id) == ("g1", "first")
        assert "--replica" in str(caught.value)
        assert "\n" not in str(caught.value)
        for robot, replica in (("g1", True), ("another", False)):
            server = ZenohServer.open(zenoh_config("tcp/127.0.0.1:0", router), robot, "second", replica, patience_s=0.0)
            assert server.stop()


def test_one_that_was_killed_is_waited_for(router: str) -> None:
    """Hazard row: service restart; the lease of the one before may not be over yet."""
    with alive(zenoh_config("tcp/127.0.0.1:0", router), "killed") as token:
        ending = threading.Timer(0.7, token.undeclare)  # joining takes 0.5 s
        ending.start()
        server = ZenohServer.open(zenoh_config("tcp/127.0.0.1:0", router), "g1", "next", patience_s=LIMIT_S)
        ending.join()
        assert server.stop()


def test_a_router_that_is_not_there_is_nobody() -> None:
    (nowhere,) = listen_locators(zenoh_config("tcp/127.0.0.1:0"))
    server = ZenohServer.open(zenoh_config("tcp/127.0.0.1:0", nowhere), "g1", "only")
    assert server.stop()


def test_whoever_is_connected_directly_is_seen() -> None:
    """Hazard row: duplicate services; as a peer that found us, without a router."""
    first = zenoh_config("tcp/127.0.0.1:0")
    (locator,) = listen_locators(first)
    with alive(first, "first"):
        second = zenoh_config("tcp/127.0.0.1:0", locator)
        assert json.loads(second.get_json("connect/endpoints")) == [locator]
        with pytest.raises(DuplicateService):
            ZenohServer.open(second, "g1", "second", patience_s=0.0)
