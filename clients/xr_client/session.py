"""One run of `ik-xr`: a headset or a recording, the teleop loop, a service and a robot.

The loop ticks at the robot's own rate in the main thread; the web server has a thread of its own, and so have images.
"""

import contextlib
import io
import json
import time
from collections.abc import Callable

import numpy as np

from ik_client.client import IKClient
from ik_client.clutch import Clutch
from ik_client.ending import come_to_rest
from ik_client.engagement import ArmEngagement
from ik_client.joint_limiter import JointLimiter
from ik_client.pacer import Pacer
from ik_client.robot_end import RobotLink
from ik_client.start import SettingsError, await_state, info_for, trusting, writable
from ik_client.teleop import TeleopLoop
from ik_proto import InfoReply
from xr_client.calibration import arm_scale, fit_neck
from xr_client.desktop import open_page
from xr_client.frames import SEED_GRIP, GripOffset, pose_of, to_robot
from xr_client.gateway import Gateway, open_gateway
from xr_client.hud_board import HudBoard
from xr_client.recording import Recorder, read_recording
from xr_client.reference import HeadReference, StandingReference
from xr_client.replay import Replay
from xr_client.run_report import RunReport
from xr_client.settings import Settings
from xr_client.stages import Stages
from xr_client.tracker import Tracker
from xr_client.video_feed import VideoFeed
from xr_client.visitors import Visitors

Say = Callable[[str], None]

_REST_TICKS = 50
"""Ticks after a replay in which the arms come to rest."""


def run(settings: Settings, say: Say, *, terminal: bool, keep_going: Callable[[], bool]) -> RunReport:
    """Run until it is asked to end, or the recording has.

    Args:
        settings: What to run.
        say: Tells a person a line; the first is a line of JSON where the output is no terminal.
        terminal: Whether the output is one.
        keep_going: Asked before every tick.

    Returns:
        What was done; it has been written to the file that was asked for.

    Raises:
        ValueError: Options, recordings, certificates, ports or addresses cannot be used.
        IKError: Service or robot cannot be reached at the beginning.
    """
    tracker, stages = _tracker(settings), Stages()
    recorded = read_recording(settings.replay) if settings.replay else None
    keep = writable(settings.report)
    with contextlib.ExitStack() as stack:
        robot = stack.enter_context(RobotLink(settings.robot, ssl=trusting(settings.ca)))
        period = robot.welcome.period
        info = info_for(robot, settings.robot, settings.service, settings.ca)
        client = stack.enter_context(IKClient(settings.service, timeout=0.5 * period, ca=settings.ca))
        board = HudBoard(stages)
        source = Replay(recorded, tracker, lambda: board.robot_ready) if recorded else tracker
        loop = TeleopLoop(
            client,
            source,
            robot,
            JointLimiter(len(info.joint_names), period, lower=info.lower, upper=info.upper),
            arms=(_arm(settings, info), _arm(settings, info)),
            feed_forward=True,
        )
        gateway = None
        if recorded is None:
            record = _recorder(settings, stack)
            gateway = stack.enter_context(
                open_gateway(settings, tracker, board, stages, clear=loop.clear, record=record, say=say)
            )
            _feed(settings, robot, gateway, board, stack)
            _welcome(gateway, say, terminal=terminal)
        await_state(robot)
        report = RunReport(stages, tracker)
        stack.callback(keep, report.write)
        _loop(loop, board, source, gateway, report, Pacer(period), keep_going, say)
        if settings.release:
            loop.release()
            given = robot.release()
            say("the robot has taken its arms back" if given else "the robot has not taken its arms back: it holds")
        else:
            say("the robot holds its arms where they are")
    return report


def _loop(
    loop: TeleopLoop,
    board: HudBoard,
    source: Replay | Tracker,
    gateway: Gateway | None,
    report: RunReport,
    pacer: Pacer,
    keep_going: Callable[[], bool],
    say: Say,
) -> None:
    visitors, rest = Visitors(), _REST_TICKS
    tracker = source.tracker if isinstance(source, Replay) else source
    age_ms = gateway.pose.age_ms if gateway else None

    def tick() -> None:
        done = loop.tick()
        report.stages.observe(done, tracker.used, age_ms)
        board.observe(done)
        for line in report.observe(done):
            say(line)

    while keep_going() and rest:
        pacer.wait()
        report.paced(pacer)
        tick()
        if gateway is not None:
            pose = gateway.pose
            for line in visitors.look(tracker.connections, pose.connected, pose.device, time.monotonic()):
                say(line)
        rest -= isinstance(source, Replay) and source.finished
    come_to_rest(loop, "ik-xr ends", tick, pacer)


def _welcome(gateway: Gateway, say: Say, *, terminal: bool) -> None:
    """Tell how to get to the page; with an emulated headset, open it where there is a screen."""
    if not terminal:
        urls = {"pages": gateway.pages, "local": gateway.local, "install": gateway.install}
        say(json.dumps(urls | {"emulator": gateway.emulator}))
        return
    for line in gateway.describe(with_qr_code=not gateway.emulator):
        say(line)
    if gateway.emulator:
        open_page(gateway.emulator)


def _feed(settings: Settings, robot: RobotLink, gateway: Gateway, board: HudBoard, stack: contextlib.ExitStack) -> None:
    """Show the robot's eye images to whoever watches."""
    if settings.video == "off":
        return
    url = robot.welcome.eyes if settings.video == "auto" else settings.video
    feed = stack.enter_context(VideoFeed(url, robot.welcome.robot, gateway.video))
    board.explain_pictures(lambda: feed.fault if gateway.video.watched else "")


def _tracker(settings: Settings) -> Tracker:
    if settings.reference == "openwbt":
        return Tracker(HeadReference(), SEED_GRIP)
    neck = None
    if settings.neck is not None:
        heads = [one.packet.head for one in read_recording(settings.neck) if one.packet.head is not None]
        neck = fit_neck(np.array([to_robot(pose_of(head[:3], head[3:])) for head in heads]).reshape(-1, 4, 4))
    return Tracker(StandingReference(neck), GripOffset())


def _arm(settings: Settings, info: InfoReply) -> ArmEngagement:
    """How a hand engages: relative to where it gripped, or at its word."""
    if settings.reference == "openwbt":
        return ArmEngagement.absolute()
    scale = settings.scale or 1.0
    if settings.arm_length is not None:
        scale = arm_scale(settings.arm_length, float(np.min(info.reach)))
    return ArmEngagement(clutch=Clutch(scale))


def _recorder(settings: Settings, stack: contextlib.ExitStack) -> Callable[[bytes, float], None]:
    if settings.record is None:
        return lambda _data, _now: None
    try:
        file = stack.enter_context(settings.record.open("wb"))
    except OSError as error:
        raise SettingsError(f"{settings.record} cannot be written: {error.strerror}") from None
    assert isinstance(file, io.BufferedWriter)
    return Recorder(file).write
