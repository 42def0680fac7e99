"""The client and its loop against the real daemon: answers over both transports, and its hang, death and return."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest

from ik_client import (
    BadRequest,
    Command,
    IKClient,
    LoopState,
    RobotState,
    ServiceTimeout,
    ServiceUnavailable,
    StepLimiter,
    TeleopLoop,
    TickReport,
    WristTargets,
)

STEP = 0.01
TICKS_TO_RETURN = 3000


@pytest.fixture(params=["tcp", "zenoh"])
def scheme(request):
    return request.param


def url_of(service, scheme):
    return service.tcp_url if scheme == "tcp" else service.zenoh_url


def test_both_transports_give_the_same_answer_to_the_last_bit(service_process):
    with IKClient(service_process.tcp_url, timeout=5.0) as tcp, IKClient(service_process.zenoh_url, timeout=5.0) as zen:
        info = tcp.info()
        n = len(info.joint_names)
        q = np.random.default_rng(3).uniform(0.3 * info.lower, 0.3 * info.upper, n)
        wrists = tcp.fk(q)
        start = np.zeros(n)
        one = tcp.solve(wrists.left_wrist, wrists.right_wrist, start)
        two = zen.solve(wrists.left_wrist, wrists.right_wrist, start)
        assert one.success
        assert one.sol_q is not None
        assert two.sol_q is not None
        assert one.sol_q.tobytes() == two.sol_q.tobytes()
        assert tcp.boot_id == zen.boot_id == info.boot_id
        # The reply tells the truth: its residual is what fk says of its joints.
        reached = tcp.fk(one.sol_q)
        assert one.position_error is not None
        error = np.linalg.norm(reached.left_wrist[:3, 3] - wrists.left_wrist[:3, 3])
        assert one.position_error[0] == pytest.approx(error, abs=1e-9)


def test_an_unknown_preset_is_refused_by_name(service_process, scheme):
    with IKClient(url_of(service_process, scheme), timeout=5.0, preset="splendid") as ik:
        eye = np.eye(4)
        with pytest.raises(BadRequest, match="splendid"):
            ik.solve(eye, eye, np.zeros(len(ik.info().joint_names)))


class Arm:
    """Follows its commands exactly; the tracker asks for one pose of it."""

    def __init__(self, ik: IKClient) -> None:
        info = ik.info()
        self.q = np.zeros(len(info.joint_names))
        goal = ik.fk(0.25 * info.upper)
        self.goal = goal.left_wrist, goal.right_wrist
        self.commands: list[Command] = []

    def read(self) -> RobotState:
        return RobotState(self.q, np.zeros(len(self.q)), 0.0)

    def send(self, command: Command) -> None:
        self.commands.append(command)
        self.q = command.q

    def targets(self, now: float) -> WristTargets:
        return WristTargets(*self.goal, now)


def tick_until(loop: TeleopLoop, state: LoopState) -> TickReport:
    for _ in range(TICKS_TO_RETURN):
        report = loop.tick()
        if report.state is state:
            return report
    raise AssertionError(f"never {state}: {report.reason}")


def test_the_robot_holds_while_the_service_hangs_or_is_dead_and_resumes_without_a_jump(start_service, scheme):
    first = start_service()
    with IKClient(url_of(first, scheme), timeout=0.05) as ik:
        arm = Arm(ik)
        loop = TeleopLoop(ik, arm, arm, StepLimiter(STEP))
        boot_id = tick_until(loop, LoopState.TRACKING).boot_id

        first.process.send_signal(signal.SIGSTOP)
        try:
            held = hold(loop)
        finally:
            first.process.send_signal(signal.SIGCONT)
        assert tick_until(loop, LoopState.TRACKING).boot_id == boot_id

        first.stop(signal.SIGKILL)
        held = hold(loop)
        start_service("--tcp", first.ready["tcp"], "--zenoh", first.ready["zenoh"])
        assert tick_until(loop, LoopState.TRACKING).boot_id not in ("", boot_id)
        for _ in range(100):
            loop.tick()
    assert np.abs(np.diff([command.q for command in arm.commands], axis=0)).max() <= STEP
    assert np.abs(arm.commands[-1].q - held.q).max() > STEP


def hold(loop: TeleopLoop) -> Command:
    """The command that is held, after making sure that it is."""
    held = tick_until(loop, LoopState.HOLDING).command
    for _ in range(10):
        report = loop.tick()
        assert report.state is LoopState.HOLDING
        assert isinstance(report.fault, ServiceUnavailable | ServiceTimeout)
        assert report.command.q.tobytes() == held.q.tobytes()
    return held


def test_a_process_ends_although_the_service_hangs_and_clients_were_never_closed(start_service):
    service = start_service()
    program = f"""
import os, signal
from ik_client import IKClient
urls = {[service.tcp_url, service.zenoh_url]!r}
closed = [IKClient(url, timeout=1.0) for url in urls]
forgotten = [IKClient(url, timeout=1.0) for url in urls]
os.kill({service.process.pid}, signal.SIGSTOP)
for ik in closed:
    ik.close()
"""
    try:
        run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=False)
    finally:
        service.process.send_signal(signal.SIGCONT)
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize("workload", ["tracking", "random", "unreachable"])
def test_ik_load_runs_against_the_daemon(service_process, scheme, workload, tmp_path):
    file = tmp_path / "load.json"
    options = ["--rate=50", "--duration=0.5", "--warmup=0.1", f"--workload={workload}", f"--json={file}"]
    run = subprocess.run(
        [sys.executable, "-m", "ik_client.load", url_of(service_process, scheme), *options],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    requests = json.loads(file.read_text())["requests"]
    assert requests["answered"] == requests["due"] > 20
    if workload == "unreachable":
        assert set(requests["statuses"]) == {"unreachable"}
    if workload == "tracking":
        assert requests["statuses"]["ok"] > 0.9 * requests["due"]
