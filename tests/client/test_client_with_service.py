"""The client and its loop against the real daemon: answers over both transports, and its hang, death and return."""

import itertools
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from ik_client import (
    ArmEngagement,
    ArmState,
    BadRequest,
    Command,
    GateLimits,
    Hands,
    HandSample,
    IKClient,
    LoopState,
    PoseGate,
    RobotState,
    ServiceTimeout,
    ServiceUnavailable,
    TeleopLoop,
    TickReport,
)
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_proto import MAX_BATCH

TICK = 0.02
LIMIT = 30.0


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


def test_the_largest_batch_with_everything_in_it_is_its_rows_over_both_transports(service_process):
    rng = np.random.default_rng(4)
    with (
        IKClient(service_process.tcp_url, timeout=20.0) as tcp,
        IKClient(service_process.zenoh_url, timeout=20.0) as zen,
    ):
        info = tcp.info()
        n, N = len(info.joint_names), MAX_BATCH
        q = rng.uniform(0.2 * info.lower, 0.2 * info.upper, (N, n))
        goal = tcp.fk(0.25 * info.upper)
        targets = np.tile(goal.left_wrist, (N, 1, 1)), np.tile(goal.right_wrist, (N, 1, 1))
        for target in targets:
            target[:, :3, 3] += rng.normal(0.0, 0.02, (N, 3))
        options: dict[str, Any] = {
            "waist": rng.normal(0.0, 0.1, (N, len(info.waist_joints))),
            "left_elbow": rng.normal(size=(N, 4)) * [1.0, 1.0, 1.0, 0.0] + [0.0, 0.0, 0.0, 0.5],
            "right_elbow": rng.normal(size=(N, 4)) * [1.0, 1.0, 1.0, 0.0] + [0.0, 0.0, 0.0, 1.0],
            "weights": rng.uniform(0.0, 1.0, (N, 2, 2)),
        }
        one = tcp.solve_batch(*targets, q, np.zeros((N, n)), **options)
        two = zen.solve_batch(*targets, q, **options)
        for name in ("sol_q", "tau", "position_error", "rotation_error", "clearance"):
            assert getattr(one, name).tobytes() == getattr(two, name).tobytes(), name
        assert one.statuses == two.statuses
        assert one.clearance is not None
        for k in range(0, N, 100):
            row = {name: rows[k] for name, rows in options.items()}
            alone = tcp.solve(targets[0][k], targets[1][k], q[k], **row)
            assert alone.status == one.statuses[k]
            assert alone.sol_q is not None
            assert alone.sol_q.tobytes() == one.sol_q[k].tobytes()
            assert alone.clearance == one.clearance[k]


def test_reach_finds_what_is_far_and_says_how(service_process, scheme):
    with IKClient(url_of(service_process, scheme), timeout=5.0) as ik:
        info = ik.info()
        left = np.array([-0.3, 0.35, 0.0, 1.0, 0.0, 0.0, 0.0])  # away from the body
        wrists = ik.fk(np.concatenate([left, left * [1, -1, -1, 1, -1, 1, -1]]))
        reply = ik.solve(wrists.left_wrist, wrists.right_wrist, 0.9 * info.lower, mode="reach")
        assert reply.status == "ok"
        assert reply.clearance is not None
        assert reply.clearance >= info.margin
        assert reply.position_error is not None
        assert reply.position_error.max() < 1e-4
        assert reply.start is not None
        assert reply.starts is not None
        assert 0 <= reply.start <= reply.starts <= 64


def test_an_unknown_preset_is_refused_by_name(service_process, scheme):
    with IKClient(url_of(service_process, scheme), timeout=5.0, preset="splendid") as ik:
        eye = np.eye(4)
        with pytest.raises(BadRequest, match="splendid"):
            ik.solve(eye, eye, np.zeros(len(ik.info().joint_names)))


class Arm:
    """Follows its commands exactly; its operator holds one pose of it, and grips again when disarmed."""

    def __init__(self, ik: IKClient) -> None:
        info = ik.info()
        self.q = np.zeros(len(info.joint_names))
        goal = ik.fk(0.25 * info.upper)
        self.goal = goal.left_wrist, goal.right_wrist
        self.commands: list[Command] = []
        self.grip = False

    def read(self) -> RobotState:
        return RobotState(self.q, np.zeros(len(self.q)), 0.0)

    def send(self, command: Command) -> None:
        self.commands.append(command)
        self.q = command.q

    def hands(self, now: float) -> Hands:
        left, right = (HandSample(T, self.grip, now) for T in self.goal)
        return Hands(left, right)


def absolute_arm() -> ArmEngagement:
    gate = PoseGate(GateLimits(freeze_time=float("inf")))
    return ArmEngagement.absolute(gate)


class Operated:
    """A loop around an arm, with a clock that advances by a tick a tick, so that a slow machine changes nothing."""

    def __init__(self, ik: IKClient) -> None:
        self.arm = Arm(ik)
        self.now = 0.0
        arms = absolute_arm(), absolute_arm()
        limiter = JointLimiter(len(self.arm.q), TICK)
        self.loop = TeleopLoop(ik, self.arm, self.arm, limiter, arms=arms, clock=lambda: self.now)

    def tick(self) -> TickReport:
        self.now += TICK
        return self.loop.tick()

    def engage(self) -> TickReport:
        """Let go and grip, again and again until the arm follows: a grip while the service is not heard is void."""
        return self.tick_until(
            lambda report: report.state is LoopState.TRACKING, grips=itertools.cycle([False] + 4 * [True])
        )

    def tick_until(self, true_of: Callable[[TickReport], bool], grips: Iterator[bool] | None = None) -> TickReport:
        end = time.monotonic() + LIMIT
        while time.monotonic() < end:
            self.arm.grip = next(grips) if grips else self.arm.grip
            report = self.tick()
            if true_of(report):
                return report
        raise AssertionError(f"never: {report.reason}")

    def disarmed(self) -> bool:
        return self.loop.states == (ArmState.DISARMED, ArmState.DISARMED)


def test_the_robot_holds_while_the_service_hangs_or_is_dead_and_goes_on_after_a_new_grip(start_service, scheme):
    """Hazards: service crash, service restart, lost connection; with a real service, killed and stopped for real."""
    first = start_service()
    with IKClient(url_of(first, scheme), timeout=0.05) as ik:
        operated = Operated(ik)
        boot_id = operated.engage().boot_id

        first.process.send_signal(signal.SIGSTOP)
        try:
            hold(operated)
        finally:
            first.process.send_signal(signal.SIGCONT)
        assert operated.engage().boot_id == boot_id

        first.stop(signal.SIGKILL)
        held = hold(operated)
        start_service("--tcp", first.ready["tcp"], "--zenoh", first.ready["zenoh"])
        for _ in range(20):
            assert (
                operated.tick().command.q.tobytes() == held.q.tobytes()
            )  # the grip is still held, and counts no longer
        assert operated.engage().boot_id not in ("", boot_id)
        for _ in range(100):
            operated.tick()
    q = np.array([command.q for command in operated.arm.commands])
    limits = MotionLimits()
    assert np.abs(np.diff(q, axis=0)).max() <= limits.velocity * TICK * 1.000001
    assert np.abs(np.diff(q, 2, axis=0)).max() <= limits.acceleration * TICK**2 * 1.000001
    assert np.abs(q[-1] - held.q).max() > 0.02


def hold(operated: Operated) -> Command:
    """The command that is held once both arms are disarmed, after making sure that it is."""
    report = operated.tick_until(lambda report: report.state is LoopState.HOLDING)
    assert isinstance(report.fault, ServiceUnavailable | ServiceTimeout)
    held = operated.tick_until(lambda _: operated.disarmed()).command
    for _ in range(10):
        report = operated.tick()
        assert report.state is LoopState.HOLDING
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
    options += ["--collision=off"]  # the workloads know nothing of the body
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
