"""Fixtures shared by the whole suite."""

import fcntl
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# Shared machines are noisy: how long an example takes says nothing about the code.
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("suite")

REPO = Path(__file__).resolve().parents[1]
START_LIMIT_S = 60.0
STOP_LIMIT_S = 10.0
MOST_WORKERS = 4
"""Beyond these, starting workers and their services takes longer than they save."""

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A script that ran this with `&` had it ignore Ctrl-C, and so would every program whose Ctrl-C is tested here.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """How many processes share the tests with `-n auto`; 0 runs them in this one.

    The whole suite and its folders are shared out. Single files are not, nor is a run whose output goes straight to the
    terminal (`-s`), nor one of the slow tests, which measure. A number on the command line (`-n 2`) comes before this.
    """
    files = all(Path(argument.split("::")[0]).is_file() for argument in config.args)
    if files or config.option.capture == "no" or config.option.markexpr != "not slow":
        return 0
    return min(len(os.sched_getaffinity(0)), MOST_WORKERS)


@pytest.fixture(scope="session")
def run_folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of this run of the suite, the same in all its processes."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if hasattr(request.config, "workerinput") else own


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder with recorded motion and tracking data; the test is skipped where it is absent."""
    folder = Path(os.environ.get("IK_DATA", REPO.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"recorded data not found at {folder}; set IK_DATA to its folder")
    return folder


@dataclass
class ServiceProcess:
    """A running `ik-service serve`.

    Attributes:
        process: The process.
        ready: Its ready line: addresses, boot_id, kernel...
        log: File with its standard error.
    """

    process: subprocess.Popen[bytes]
    ready: dict[str, Any]
    log: Path

    @property
    def tcp(self) -> tuple[str, int]:
        """Address of the TCP endpoint."""
        host, port = self.ready["tcp"].rsplit(":", 1)
        return host, int(port)

    @property
    def tcp_url(self) -> str:
        """URL of the TCP endpoint, for a client."""
        return f"tcp://{self.ready['tcp']}"

    @property
    def zenoh_url(self) -> str:
        """URL of the Zenoh endpoint, for a client."""
        return f"zenoh://{self.ready['zenoh'].removeprefix('tcp/')}"

    @property
    def http_url(self) -> str:
        """URL of the HTTP endpoint."""
        return f"http://{self.ready['http']}"

    def stop(self, number: int = signal.SIGTERM) -> int:
        """Send a signal, wait, and give the exit code; negative for a death by signal."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.process.wait(STOP_LIMIT_S)


StartService = Callable[..., ServiceProcess]


@pytest.fixture(scope="session")
def kernel_cache(run_folder: Path) -> Path:
    """Folder with the compiled kernels of the G1, built by whichever process of this run asks first."""
    # Imported here: a test of the contract or the client alone need not wait for the solver's libraries.
    from ik_proto.robots import load_description
    from ik_service.kernel import building_kernel
    from ik_service.robot import Robot
    from ik_service.velocity_kernel import building_velocity_kernel

    folder = run_folder / "kernels"
    folder.mkdir(mode=0o700, exist_ok=True)
    with (run_folder / "kernels.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not any(folder.iterdir()):
            robot = Robot.load(load_description("g1"))
            with (
                building_kernel(robot, folder=folder) as solving,
                building_velocity_kernel(robot, folder=folder) as moving,
            ):
                solving(), moving()
    return folder


@pytest.fixture(scope="session")
def _starter(kernel_cache: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[StartService]:
    started: list[ServiceProcess] = []
    logs = tmp_path_factory.mktemp("logs")

    def start(*arguments: str) -> ServiceProcess:
        free = {"--tcp": "127.0.0.1:0", "--zenoh": "tcp/127.0.0.1:0", "--http": "127.0.0.1:0", "--log-format": "json"}
        defaults = [part for flag, value in free.items() if flag not in arguments for part in (flag, value)]
        log = logs / f"{len(started)}.log"
        with log.open("wb") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "ik_service", "serve", *defaults, *arguments],
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**os.environ, "IK_CACHE_DIR": str(kernel_cache)},
            )
        service = ServiceProcess(process, {}, log)
        started.append(service)
        service.ready = _ready_line(service)
        return service

    yield start
    for service in started:
        if service.process.poll() is None:
            service.process.kill()
        service.process.wait()
        assert service.process.stdout is not None
        service.process.stdout.close()


def _ready_line(service: ServiceProcess) -> dict[str, Any]:
    output = service.process.stdout
    assert output is not None
    deadline = time.monotonic() + START_LIMIT_S
    while not select.select([output], [], [], 0.1)[0]:
        assert time.monotonic() < deadline, f"no ready line within {START_LIMIT_S} s: {service.log.read_text()}"
    line = output.readline()
    assert line, f"exit code {service.process.wait()} instead of a ready line: {service.log.read_text()}"
    return json.loads(line)


@pytest.fixture
def start_service(_starter: StartService) -> Iterator[StartService]:
    """Start `ik-service serve` with these arguments on free ports; stopped when the test ends."""
    mine: list[ServiceProcess] = []

    def start(*arguments: str) -> ServiceProcess:
        mine.append(_starter(*arguments))
        return mine[-1]

    yield start
    for service in mine:
        if service.process.poll() is None:
            service.process.kill()
            service.process.wait()


@pytest.fixture(scope="session")
def service_process(_starter: StartService) -> ServiceProcess:
    """One service for all tests that only talk to it."""
    return _starter()
