"""A service that other machines can reach: token on every way in, TLS, and nothing secret in what it says or logs."""

import contextlib
import json
import socket
import ssl
import stat
import struct
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
from certificates import make_certificates

from ik_client import IKClient, IKError, ServiceUnavailable, Unauthorized
from ik_proto import MAX_BATCH, MAX_FRAME_BYTES
from ik_service.cli import main

pytestmark = pytest.mark.timeout(60)
LIMIT_S = 10.0


class Secured:
    """A running service, and what its clients need."""

    def __init__(self, service: Any, folder: Path) -> None:
        self.service = service
        self.ca = folder / "ca.pem"
        self.token = (folder / "ik.token").read_text().strip()
        self.port = int(service.ready["tcp"].rsplit(":", 1)[1])
        self.tls_url = f"tls://localhost:{self.port}"

    @contextlib.contextmanager
    def connection(self) -> Generator["RawTls"]:
        """A raw connection."""
        context = ssl.create_default_context(cafile=str(self.ca))
        with (
            socket.create_connection(("127.0.0.1", self.port), LIMIT_S) as plain,
            context.wrap_socket(plain, server_hostname="localhost") as connection,
            connection.makefile("rb") as replies,
        ):
            yield RawTls(connection, replies)


@dataclass
class RawTls:
    """A socket with TLS, and the framing."""

    connection: ssl.SSLSocket
    replies: BinaryIO

    def ask(self, body: bytes, length: int | None = None) -> dict[str, Any]:
        """Send a body, under another length than its own if need be, and read the reply."""
        self.connection.sendall(struct.pack(">I", len(body) if length is None else length) + body)
        (count,) = struct.unpack(">I", self.replies.read(4))
        return json.loads(self.replies.read(count))


@pytest.fixture(scope="module")
def secured(_starter: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secured]:
    folder = make_certificates(tmp_path_factory.mktemp("secured"))
    assert main(["token", str(folder / "ik.token")]) == 0
    options = {"token-file": "ik.token", "tls-cert": "service.pem", "tls-key": "service.key"}
    files = [part for name, file in options.items() for part in (f"--{name}", str(folder / file))]
    service = _starter("--tcp", "0.0.0.0:0", "--kernel", "vm", "--log-level", "debug", *files)
    yield Secured(service, folder)
    service.stop()


def solves(ik: IKClient) -> bool:
    q = np.zeros(14)
    wrists = ik.fk(q)
    return ik.solve(wrists.left_wrist, wrists.right_wrist, q).success


def a_large_batch(ik: IKClient) -> bool:
    q = np.zeros((MAX_BATCH, 14))
    wrists = ik.fk(q[0])
    left, right = (np.tile(wrist, (MAX_BATCH, 1, 1)) for wrist in (wrists.left_wrist, wrists.right_wrist))
    return ik.solve_batch(left, right, q).success


def test_who_has_the_token_is_served_on_every_way_in(secured: Secured) -> None:
    """Hazard row: auth."""
    with IKClient(secured.tls_url, timeout=LIMIT_S, ca=secured.ca, token=secured.token) as ik:
        assert solves(ik)
        assert a_large_batch(ik)
    with IKClient(secured.service.zenoh_url, timeout=LIMIT_S, token=secured.token) as ik:
        assert solves(ik)
        assert a_large_batch(ik)


@pytest.mark.parametrize("token", ["", "a-wrong-token-of-the-test"])
def test_who_has_not_is_not(secured: Secured, token: str) -> None:
    """Hazard row: auth."""
    for url, ca in ((secured.tls_url, secured.ca), (secured.service.zenoh_url, None)):
        with pytest.raises(Unauthorized):
            IKClient(url, timeout=LIMIT_S, ca=ca, token=token)
        with IKClient(url, timeout=LIMIT_S, ca=ca, token=token, connect=False) as ik, pytest.raises(Unauthorized):
            ik.solve_batch(*np.tile(np.eye(4), (2, MAX_BATCH, 1, 1)), np.zeros((MAX_BATCH, 14)))


def test_who_does_not_speak_tls_gets_one_line(secured: Secured) -> None:
    with pytest.raises(ServiceUnavailable, match="if it speaks TLS, write tls://") as caught:
        IKClient(f"tcp://127.0.0.1:{secured.port}", token=secured.token, connect_timeout=0.1)
    assert "\n" not in str(caught.value)


def test_a_service_without_tls_is_told_as_such(service_process: Any, secured: Secured) -> None:
    with pytest.raises(ServiceUnavailable, match="does not speak TLS; write tcp://"):
        IKClient(f"tls://{service_process.ready['tcp']}", ca=secured.ca, connect_timeout=0.1)


@pytest.mark.parametrize(
    ("path", "authorization", "status"),
    [
        ("/healthz", "", 200),
        ("/readyz", "", 200),
        ("/metrics", "", 401),
        ("/metrics", "Bearer a-wrong-token-of-the-test", 401),
        ("/metrics", "Bearer \u00e9\u00ff", 401),
        ("/metrics", "Bearer {token}", 200),
    ],
)
def test_metrics_want_the_token_and_health_does_not(
    secured: Secured, path: str, authorization: str, status: int
) -> None:
    """Hazard row: auth."""
    headers = {"Authorization": authorization.format(token=secured.token)} if authorization else {}
    try:
        with urllib.request.urlopen(
            urllib.request.Request(secured.service.http_url + path, headers=headers), timeout=LIMIT_S
        ) as answer:
            assert answer.status == status
    except urllib.error.HTTPError as error:
        with error:
            assert error.code == status
            assert secured.token not in error.read().decode()


def test_refusals_tell_nothing_and_are_read_to_the_end_over_tls(secured: Secured) -> None:
    info = json.dumps({"verb": "info", "token": secured.token}).encode()
    with secured.connection() as raw:
        said = [
            raw.ask(b'{"verb": "info"}'),
            raw.ask(b"x" * 70_000),  # not read
            raw.ask(info),
            raw.ask(b"x" * 70_000),  # read, now that it is trusted
            raw.ask(b'{"verb": "info"}'),
            raw.ask(b"", MAX_FRAME_BYTES + 1),
        ]
        assert raw.replies.read() == b""  # then it is closed, which does not cut that last reply
    statuses = [reply["status"] for reply in said]
    assert statuses == ["unauthorized", "unauthorized", "ok", "bad_request", "ok", "bad_request"]
    assert secured.token not in str(said)


def test_neither_the_log_nor_the_ready_line_holds_the_token(secured: Secured) -> None:
    """After all that the tests above have sent."""
    for token in (secured.token, "", "a-wrong-token-of-the-test"):
        with contextlib.suppress(IKError), IKClient(secured.tls_url, ca=secured.ca, token=token) as ik:
            assert solves(ik)
    with secured.connection() as raw:
        raw.ask(json.dumps({"verb": "nonsense", "token": secured.token}).encode())
        raw.ask(json.dumps({"verb": "info", "token": [secured.token]}).encode())
    log = secured.service.log.read_text()
    assert "front ends open" in log
    for text in (log, json.dumps(secured.service.ready)):
        assert secured.token not in text
        assert "a-wrong-token-of-the-test" not in text


def test_the_command_writes_a_token_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "ik.token"
    assert main(["token", str(file)]) == 0
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    token = file.read_text().strip()
    assert main(["token", str(file)]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert token not in said.out + said.err


def test_a_second_service_of_a_robot_exits_with_3_unless_it_is_to_be_a_replica(
    service_process: Any, start_service: Callable[..., Any]
) -> None:
    """Hazard row: duplicate services."""
    network = ["--zenoh-connect", service_process.ready["zenoh"], "--tcp", "off", "--http", "off", "--kernel", "vm"]
    command = [sys.executable, "-m", "ik_service", "serve", "--zenoh", "tcp/127.0.0.1:0", *network]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 3
    assert result.stderr.count("\n") == 1
    assert "--replica" in result.stderr
    assert service_process.ready["boot_id"] in result.stderr
    assert result.stdout == ""
    replica = start_service("--replica", *network)
    with IKClient(replica.zenoh_url, timeout=LIMIT_S) as ik:
        assert ik.info().robot == "g1"
    assert replica.stop() == 0
