"""One run of `ik-xr`: a headset or a recording, the teleop loop, a service and a robot.

The loop ticks at the robot's own rate in the main thread; the web server has a thread of its own.
"""

import contextlib
import io
import json
import ssl
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ik_client.client import IKClient
from ik_client.clutch import Clutch
from ik_client.engagement import ArmEngagement
from ik_client.joint_limiter import JointLimiter
from ik_client.robot_end import RobotLink
from ik_client.state_machine import ArmState
from ik_client.teleop import TeleopLoop
from ik_client.tick_report import TickReport
from ik_proto import InfoReply
from xr_client.calibration import arm_scale, fit_neck
from xr_client.frames import SEED_GRIP, GripOffset, pose_of, to_robot
from xr_client.gateway import open_gateway
from xr_client.hud_board import HudBoard
from xr_client.pacer import Pacer
from xr_client.recording import Recorder, read_recording
from xr_client.reference import HeadReference, StandingReference
from xr_client.replay import Replay
from xr_client.settings import Settings, SettingsError
from xr_client.tracker import Tracker

Say = Callable[[str], None]

_INFO_TIMEOUT = 2.0
_REST_TICKS = 50
"""Ticks after a replay in which the arms come to rest."""


@dataclass
class Summary:
    """What a run did.

    Attributes:
        ticks: Ticks of the loop.
        active: Ticks in which an arm followed a hand.
        engagements: How often an arm began to follow.
        late: Ticks that began late.
    """

    ticks: int = 0
    active: int = 0
    engagements: int = 0
    late: int = 0


def run(settings: Settings, say: Say, *, terminal: bool, keep_going: Callable[[], bool]) -> Summary:
    """Run until it is asked to end, or the recording has.

    Args:
        settings: What to run.
        say: Tells a person a line; the first is a line of JSON where the output is no terminal.
        terminal: Whether the output is one.
        keep_going: Asked before every tick.

    Returns:
        What was done.

    Raises:
        ValueError: Options, recordings, certificates, ports or addresses cannot be used.
        IKError: Service or robot cannot be reached at the beginning.
    """
    tracker = _tracker(settings)
    recorded = read_recording(settings.replay) if settings.replay else None
    with contextlib.ExitStack() as stack:
        robot = stack.enter_context(RobotLink(settings.robot, ssl=_trusting(settings)))
        period = robot.welcome.period
        info = _info(settings, robot)
        client = stack.enter_context(IKClient(settings.service, timeout=0.5 * period, ca=settings.ca))
        board = HudBoard()
        source = Replay(recorded, tracker, lambda: board.robot_ready) if recorded else tracker
        loop = TeleopLoop(
            client,
            source,
            robot,
            JointLimiter(len(info.joint_names), period, lower=info.lower, upper=info.upper),
            arms=(_arm(settings, info), _arm(settings, info)),
            feed_forward=True,
        )
        if recorded is None:
            recorder = _recorder(settings, stack)
            gateway = stack.enter_context(open_gateway(settings, tracker, board, loop.clear, recorder))
            if terminal:
                for line in gateway.describe(with_qr_code=True):
                    say(line)
            else:
                say(json.dumps({"pages": gateway.pages, "local": gateway.local, "install": gateway.install}))
        summary = _loop(loop, board, source, Pacer(period), keep_going, say)
        if settings.release:
            loop.release()
            given = robot.release()
            say("the robot has taken its arms back" if given else "the robot has not taken its arms back: it holds")
        else:
            say("the robot holds its arms where they are")
    return summary


def _loop(
    loop: TeleopLoop,
    board: HudBoard,
    source: Replay | Tracker,
    pacer: Pacer,
    keep_going: Callable[[], bool],
    say: Say,
) -> Summary:
    summary, states = Summary(), loop.states
    rest = _REST_TICKS
    while keep_going() and rest:
        pacer.wait()
        report = loop.tick()
        board.observe(report)
        states = _announce(report, states, summary, say)
        rest -= isinstance(source, Replay) and source.finished
    loop.stop("ik-xr ends")
    board.observe(loop.tick())
    summary.late = pacer.late
    return summary


def _announce(report: TickReport, before: tuple[ArmState, ...], summary: Summary, say: Say) -> tuple[ArmState, ...]:
    """Count a tick, and tell what has changed."""
    states = tuple(arm.state for arm in report.arms)
    for name, arm, was in zip(("left", "right"), report.arms, before, strict=True):
        if arm.state is not was:
            summary.engagements += arm.state is ArmState.ACTIVE
            say(f"{name} arm: {arm.state}" + (f", {arm.reason}" if arm.reason else ""))
    summary.ticks += 1
    summary.active += ArmState.ACTIVE in states
    return states


def _trusting(settings: Settings) -> ssl.SSLContext | None:
    if settings.ca is None:
        return None
    try:
        return ssl.create_default_context(cafile=settings.ca)
    except OSError as error:  # an ssl.SSLError is one too
        raise SettingsError(f"{settings.ca} holds no certificate of an authority ({error.strerror})") from None


def _info(settings: Settings, robot: RobotLink) -> InfoReply:
    """What the service says of itself; it must serve this very robot."""
    with IKClient(settings.service, timeout=_INFO_TIMEOUT, ca=settings.ca) as asking:
        info = asking.info()
    if tuple(info.joint_names) != robot.welcome.joint_names:
        raise SettingsError(
            f"{settings.service} serves robot {info.robot!r} with other arm joints than {robot.welcome.robot!r} at "
            f"{settings.robot}: start both for the same robot"
        )
    return info


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
