"""One turn: an `ik-xr` and a browser, hands that move for a while and stop; what was measured at every end."""

import json
import os
import signal
import subprocess
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser

from benchmarks.headset.album import album
from benchmarks.headset.browser import Headset, Lost, Moved, headset
from benchmarks.load.processes import child, first_line
from ik_client import IKClient
from ik_client.robot_end import RobotLink, RobotSilent
from ik_proto import Array
from xr_client.frames import T_ROBOT_OPENXR
from xr_client.recording import read_recording

MODES = ("on", "album", "stalled", "off")
"""Video shown, pictures drawn beforehand shown, video whose page says of no image that it was shown, no video."""

REST_S = 1.0
"""How long after the hands have stopped the wrists are looked at [s]."""
SETTLE_S, STEP_S, STEP = 1.5, 1.0, (0.0, 0.05, -0.05)
"""Rest before a last step of the hands, how long it takes [s], and its way to the right, up, back [m]."""
ATTEMPTS = 8
_END_LIMIT_S = 15.0
_POLL_S = 0.005


@dataclass(frozen=True, slots=True)
class World:
    """What runs all the time.

    Attributes:
        service: Address of the service.
        robot: Address of the robot.
        client: Asks the service.
        link: Watches the robot.
        folder: For files.
    """

    service: str
    robot: str
    client: IKClient
    link: RobotLink
    folder: Path

    def wrists(self, *, wanted: bool) -> Array:
        """Where the wrists are, or where the robot wants them, shape (2, 3) [m], in the pelvis frame."""
        end = time.monotonic() + _END_LIMIT_S
        while True:
            try:
                state = self.link.read()
                break
            except RobotSilent as error:
                if time.monotonic() > end:
                    raise Lost(str(error)) from None
                time.sleep(_POLL_S)
        q = state.q_set if wanted and state.q_set is not None else state.q
        reply = self.client.fk(np.asarray(q), state.waist)
        return np.array([reply.left_wrist[:3, 3], reply.right_wrist[:3, 3]])


@contextmanager
def world(folder: Path) -> Generator[World]:
    """Start a service and a robot, each with all cores."""
    everywhere = os.sched_getaffinity(0)
    serving = ["-m", "ik_service", "serve", "--tcp", "127.0.0.1:0", "--zenoh", "off", "--http", "off"]
    robot = ["-m", "sim_client", "--listen", "127.0.0.1:0", "--headless"]
    with (
        child([*serving, "--log-format", "json"], everywhere) as served,
        child(robot, everywhere) as robot_end,
    ):
        service = "tcp://" + json.loads(first_line(served, "the service"))["tcp"]
        listening = "tcp://" + json.loads(first_line(robot_end, "the robot"))["listen"]
        with IKClient(service, timeout=2.0) as client, RobotLink(listening) as link:
            yield World(service, listening, client, link, folder)


@dataclass(frozen=True, slots=True)
class Turn:
    """What a turn showed.

    Attributes:
        mode: One of `MODES`.
        seconds: How long the hands moved [s].
        poses: Packets that arrived while they did.
        missed: Sequence numbers that did not.
        gaps_ms: Time between arrivals while they did: median, 99th percentile, largest [ms].
        images: Images drawn while they did.
        wrist_mm: Distance of each wrist from its target `REST_S` after they had stopped [mm].
        changes: How often an arm changed its state while they did: where it held, because poses came late.
        report: What `ik-xr` wrote.
    """

    mode: str
    seconds: float
    poses: int
    missed: int
    gaps_ms: tuple[float, float, float]
    images: int
    wrist_mm: tuple[float, float]
    changes: int
    report: dict[str, Any]

    @property
    def poses_per_s(self) -> float:
        """Packets that arrived in a second."""
        return self.poses / self.seconds

    def stage(self, name: str, percentile: str) -> float:
        """A percentile of a stage [ms]; NaN where it had no samples."""
        return self.report["stages_ms"].get(name, {}).get(percentile, float("nan"))

    def lateness(self, percentile: str) -> float:
        """A percentile of how late ticks began [ms]."""
        return self.report["lateness_ms"][percentile]


def run_turn(around: World, browser: Browser, mode: str, seconds: float, screenshot: Path | None = None) -> Turn:
    """Run a turn.

    Args:
        around: Service and robot.
        browser: Where the page is opened.
        mode: One of `MODES`.
        seconds: How long hands move [s].
        screenshot: File for what the eyes see at the end; None for none.

    Raises:
        Lost: A part of it does not do what it must.
    """
    report, recording = around.folder / "report.json", around.folder / "turn.ikxr"
    command = [
        "-m",
        "xr_client",
        "--service",
        around.service,
        "--robot",
        around.robot,
        "--emulate",
        "--local-port",
        "0",
    ]
    command += ["--report", str(report), "--record", str(recording)]
    with _pictures(around, mode) as video, child([*command, "--video", video], os.sched_getaffinity(0)) as process:
        url = json.loads(first_line(process, "ik-xr"))["emulator"]
        with headset(browser) as worn:
            worn.enter(url, video=mode != "off")
            worn.grip()
            changes = worn.changes
            if mode == "stalled":
                worn.stall_video()
            moved = worn.circle(seconds)
            changes = worn.changes - changes
            wrist_mm = _reach(around, worn)
            if screenshot is not None:
                worn.screenshot(screenshot)
            worn.let_go()
        _end(process)
    poses, missed, gaps = _arrivals(recording, moved)
    return Turn(
        mode=mode,
        seconds=1e-3 * (moved.end - moved.begin),
        poses=poses,
        missed=missed,
        gaps_ms=gaps,
        images=moved.shown,
        wrist_mm=wrist_mm,
        changes=changes,
        report=json.loads(report.read_text(encoding="utf-8")),
    )


@contextmanager
def _pictures(around: World, mode: str) -> Generator[str]:
    """Where the pictures of a turn come from, as `--video` takes it."""
    if mode == "album":
        welcome = around.link.welcome
        with album(welcome.eyes, welcome.robot) as url:
            yield url
    else:
        yield "off" if mode == "off" else "auto"


def _reach(around: World, worn: Headset) -> tuple[float, float]:
    """Let both hands step; give the wrists' distances from their targets `REST_S` after they have stopped [mm]."""
    step = np.array(STEP)
    for _ in range(ATTEMPTS):
        if not worn.follows:
            worn.let_go()
            worn.grip()
        changes = worn.changes
        # Where the robot wants its wrists at rest is where the hands want them; and a new grip has its full effect.
        time.sleep(SETTLE_S)
        target = around.wrists(wanted=True) + T_ROBOT_OPENXR[:3, :3] @ step
        worn.step(STEP_S, (step[0], step[1], step[2]))
        time.sleep(REST_S)
        left, right = 1e3 * np.linalg.norm(around.wrists(wanted=False) - target, axis=1)
        if worn.follows and worn.changes == changes:
            return float(left), float(right)
        step = -step
    raise Lost(f"an arm held in each of {ATTEMPTS} attempts to reach: this machine is too busy")


def _arrivals(recording: Path, moved: Moved) -> tuple[int, int, tuple[float, float, float]]:
    """Packets that were captured while the hands moved, how many are missing, and the time between two [ms]."""
    found = [one for one in read_recording(recording) if moved.begin <= one.packet.capture_ms <= moved.end]
    if len(found) < 2:
        raise Lost("no poses arrived while the hands moved")
    between = 1e3 * np.diff([one.time for one in found])
    missed = int(np.sum(np.diff([one.packet.seq for one in found]) - 1))
    p50, p99 = np.percentile(between, [50.0, 99.0])
    return len(found), missed, (float(p50), float(p99), float(between.max()))


def _end(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGTERM)
    try:
        code = process.wait(_END_LIMIT_S)
    except subprocess.TimeoutExpired:
        raise Lost("ik-xr does not end") from None
    if code:
        raise Lost(f"ik-xr ended with exit code {code}")
