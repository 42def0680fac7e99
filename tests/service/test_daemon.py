"""The daemon as a process: bad input beside a client that is served, signals, exit codes, one-line errors."""

import json
import math
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ik_proto import SolveRequest, encode_frame, request_document
from ik_proto.codec import JSON
from ik_service.engine import Engine
from ik_service.solver import Solver
from ik_service.worker import WAITING

REFLECTION = np.diag([1.0, 1.0, -1.0, 1.0]).tolist()


def run(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ik_service", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, **options)


class Bystander:
    """A client that solves all the time and checks every answer against a solver in this process."""

    def __init__(self, client: Any, solver: Solver, requests: list[SolveRequest]) -> None:
        self._exchanges = [
            (JSON.encode(request_document(request)), solver.solve(request.left_wrist, request.right_wrist, request.q).q)
            for request in requests
        ]
        self._client = client
        self._enough = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self.answers = 0
        self.failure: Exception | AssertionError | None = None

    def __enter__(self) -> "Bystander":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._enough.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._enough.is_set():
                for body, expected in self._exchanges:
                    self._client.send_frame(body)
                    reply = self._client.receive()
                    np.testing.assert_allclose(reply["sol_q"], expected, atol=1e-6)
                    self.answers += 1
        except (OSError, EOFError, AssertionError, TypeError) as error:
            self.failure = error


def test_bad_input_is_answered_or_closed_and_others_are_served(
    service_process: Any,
    raw_client: Callable[..., Any],
    solver: Solver,
    document: Callable[..., dict[str, Any]],
    solve_request: Callable[[int], SolveRequest],
) -> None:
    requests = [solve_request(seed) for seed in range(10)]
    with Bystander(raw_client(service_process.tcp), solver, requests) as bystander:
        for _ in range(20):
            client = raw_client(service_process.tcp)
            nan = np.full((4, 4), math.nan).tolist()
            for changes in (
                {"left_wrist": nan},
                {"left_wrist": np.eye(3).tolist()},
                {"right_wrist": REFLECTION},
                {"q": [0.0] * 13},
            ):
                reply = client.ask(document(**changes))
                assert (reply["status"], reply["success"]) == ("bad_request", False)
            client.send_frame(b"no JSON at all")
            assert client.receive()["status"] == "bad_request"
            assert client.ask(document())["success"]

            flood = raw_client(service_process.tcp)
            flood.send(b"\xff" * 1_000_000)
            assert flood.receive()["status"] == "bad_request"
            assert flood.is_closed()

            huge = raw_client(service_process.tcp)
            huge.send(struct.pack(">I", 2**32 - 1))
            assert huge.receive()["status"] == "bad_request"
            assert huge.is_closed()

            truncated = raw_client(service_process.tcp)
            truncated.send(encode_frame(b"x" * 100)[:50])
            truncated.close()
    assert bystander.failure is None
    assert bystander.answers > 0
    assert service_process.process.poll() is None


def test_replies_of_one_client_stay_in_order(
    service_process: Any, raw_client: Callable[..., Any], document: Callable[..., dict[str, Any]]
) -> None:
    rows = {name: [value] * 8 for name, value in document().items() if isinstance(value, list)}
    requests = [
        document(1),
        {**rows, "verb": "solve_batch", "id": 12},
        {"verb": "info", "id": 13},
        document(13, mode="reach"),
        {"verb": "solve_batch", "id": 15},
        document(15),
    ]
    client = raw_client(service_process.tcp)
    client.send(b"".join(encode_frame(json.dumps(request).encode()) for request in requests))
    replies = [client.receive() for _ in requests]
    assert [reply["id"] for reply in replies] == [2, 12, 13, 14, 15, 16]
    assert [reply["status"] for reply in replies] == ["ok", "ok", "ok", "ok", "bad_request", "ok"]
    assert replies[1]["statuses"] == ["ok"] * 8


def test_long_work_delays_nobody_else_nor_the_end(
    start_service: Callable[..., Any],
    raw_client: Callable[..., Any],
    document: Callable[..., dict[str, Any]],
    endless: dict[str, Any],
) -> None:
    service = start_service("--zenoh", "off")
    patient, other = raw_client(service.tcp), raw_client(service.tcp)
    patient.send_frame(json.dumps(endless).encode())
    patient.send_frame(json.dumps(document(1)).encode())
    for seed in range(50):
        assert other.ask(document(seed))["id"] == seed + 1
    crowd = [raw_client(service.tcp) for _ in range(WAITING + 1)]
    for k, client in enumerate(crowd):
        client.send_frame(json.dumps(document(k, mode="reach")).encode())
    refused = crowd[-1].receive()
    assert (refused["status"], refused["id"], refused["sol_q"]) == ("overloaded", WAITING + 1, None)
    assert crowd[-1].ask(document(3))["success"]  # its connection stays open
    assert not patient.has_reply()
    assert service.stop() == 0
    assert [patient.receive()["status"] for _ in range(2)] == ["overloaded"] * 2
    assert patient.is_closed()
    log = [json.loads(line) for line in service.log.read_text().splitlines()]
    assert [entry["event"] for entry in log] == ["draining", "leaving work behind"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_drains_and_exits_with_0(
    start_service: Callable[..., Any],
    raw_client: Callable[..., Any],
    document: Callable[..., dict[str, Any]],
    number: int,
) -> None:
    service = start_service()
    client = raw_client(service.tcp)
    assert client.ask(document())["success"]
    client.send(encode_frame(json.dumps(document(1)).encode())[:100])
    client.send(encode_frame(json.dumps(document(1)).encode())[100:])
    assert service.stop(number) == 0
    assert client.receive()["id"] == 2  # what had arrived was answered
    assert client.is_closed()
    log = [json.loads(line) for line in service.log.read_text().splitlines()]
    assert [entry["event"] for entry in log] == ["draining", "stopped"]


def test_it_starts_again_on_the_same_ports(start_service: Callable[..., Any], raw_client: Callable[..., Any]) -> None:
    """Hazard row: service restart. Another run has another `boot_id`."""
    first = start_service()
    client = raw_client(first.tcp)
    boot_id = client.ask({"verb": "info"})["boot_id"]
    assert first.stop() == 0
    addresses = [part for flag in ("tcp", "zenoh", "http") for part in (f"--{flag}", first.ready[flag])]
    second = start_service(*addresses)
    assert second.ready["boot_id"] != boot_id
    assert raw_client(second.tcp).ask({"verb": "info"})["boot_id"] == second.ready["boot_id"]


@pytest.mark.parametrize("flag", ["--tcp", "--zenoh", "--http"])
def test_a_second_instance_exits_with_3_and_one_line(service_process: Any, flag: str) -> None:
    """Hazard row: duplicate services."""
    taken = service_process.ready[flag.removeprefix("--")]
    others = {"--tcp": "127.0.0.1:0", "--zenoh": "off", "--http": "off", flag: taken}
    result = run("serve", "--kernel", "vm", *[part for pair in others.items() for part in pair])
    assert result.returncode == 3
    assert result.stderr.count("\n") == 1
    assert taken in result.stderr
    assert flag in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["serve", "--robot", "no_such"], "no_such"),
        (["serve", "--preset", "no_such"], "no_such"),
        (["serve", "--tcp", "nonsense"], "nonsense"),
        (["serve", "--tcp", "0.0.0.0:0"], "--insecure"),
        (["serve", "--tcp", "203.0.113.1:1", "--insecure", "--zenoh", "off"], "cannot listen"),
        (["serve", "--config", "no_such.toml"], "no_such.toml"),
        (["serve", "--zenoh-config", "no_such.json5"], "no_such.json5"),
        (["serve", "--token-file", "no_such.token"], "no_such.token"),
        (["info", "--robot", "no_such"], "no_such"),
        (["healthcheck", "--http", "nonsense"], "nonsense"),
    ],
)
def test_a_mistake_exits_with_2_and_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    if arguments[0] == "serve":
        arguments = [*arguments, "--kernel", "vm", "--http", "off"]
    result = run(*arguments, cwd=tmp_path)
    assert result.returncode == 2, result.stderr
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""


def test_a_config_file_is_served(start_service: Callable[..., Any], tmp_path: Path) -> None:
    file = tmp_path / "service.toml"
    file.write_text('kernel = "vm"\nzenoh = "tcp/127.0.0.1:0"\n')
    service = start_service("--config", str(file))
    assert service.ready["kernel"] == "vm"


def test_a_front_end_can_be_off(start_service: Callable[..., Any], raw_client: Callable[..., Any]) -> None:
    service = start_service("--zenoh", "off", "--http", "off")
    assert "zenoh" not in service.ready
    assert "http" not in service.ready
    assert raw_client(service.tcp).ask({"verb": "info"})["success"]


def test_info_prints_what_would_be_served(engine: Engine) -> None:
    result = run("info", "--kernel", "vm")
    assert result.returncode == 0
    for name in engine.robot.joint_names:
        assert name in result.stdout
    assert engine.robot.model_hash in result.stdout
    for words in ("openwbt, precise (default precise)", "avoid, margin 10 mm", "waist_yaw_joint"):
        assert words in result.stdout


def test_healthcheck_tells_ready_from_gone(start_service: Callable[..., Any]) -> None:
    service = start_service("--zenoh", "off")
    result = run("healthcheck", "--http", service.ready["http"])
    assert (result.returncode, result.stdout) == (0, "ready\n")
    assert service.stop() == 0
    result = run("healthcheck", "--http", service.ready["http"])
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1


def test_help_teaches() -> None:
    text = run("serve", "--help").stdout
    for word in (
        "127.0.0.1:12345",
        "examples:",
        "exit codes:",
        "--openwbt-lag",
        "--insecure",
        "--token-file",
        "--tls-client-ca",
        "--replica",
        "(precise)",
        "{off,report,avoid}",
    ):
        assert word in text


def test_a_missing_package_is_one_line_that_says_what_to_install() -> None:
    program = "import sys; sys.modules['casadi'] = None; from ik_service.cli import main; sys.exit(main(['serve']))"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 2
    assert result.stderr == "ik-service: package casadi is missing: pip install 'ik-service[service]'\n"


def test_the_command_line_loads_nothing_heavy_before_it_must() -> None:
    program = (
        "import sys, ik_service.cli\n"
        "heavy = {'pinocchio', 'casadi', 'aiohttp', 'zenoh', 'uvloop', 'prometheus_client'} & sys.modules.keys()\n"
        "print(*sorted(heavy))"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (result.stdout, result.stderr) == ("\n", "")
