"""Fixtures that start stand-ins for the service."""

import socket
import ssl
from collections.abc import Callable, Iterator

import pytest
from fake_service import FakeService, TcpFake, ZenohFake

from ik_client import IKClient


@pytest.fixture
def service() -> FakeService:
    return FakeService()


@pytest.fixture
def start_tcp() -> Iterator[Callable[..., TcpFake]]:
    """Start stand-ins on TCP; all are stopped at the end."""
    started: list[TcpFake] = []

    def start(service: FakeService, port: int = 0, tls: ssl.SSLContext | None = None) -> TcpFake:
        started.append(TcpFake(service, port, tls))
        return started[-1]

    yield start
    for fake in started:
        fake.stop()


@pytest.fixture
def start_zenoh() -> Iterator[Callable[..., ZenohFake]]:
    """Start stand-ins on Zenoh; all are stopped at the end."""
    pytest.importorskip("zenoh")
    started: list[ZenohFake] = []

    def start(service: FakeService, endpoint: str, **options: bool | str) -> ZenohFake:
        started.append(ZenohFake(service, endpoint, **options))  # ty: ignore[invalid-argument-type]
        return started[-1]

    yield start
    for fake in started:
        fake.stop()


@pytest.fixture
def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


@pytest.fixture
def fake(service: FakeService, start_tcp: Callable[..., TcpFake]) -> TcpFake:
    return start_tcp(service)


@pytest.fixture
def ik(fake: TcpFake) -> Iterator[IKClient]:
    with IKClient(fake.url, timeout=2.0) as client:
        yield client
