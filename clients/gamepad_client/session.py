"""One run of `ik-gamepad`: devices, the rate loop, a service and a robot, all in the main thread."""

import contextlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gamepad_client.displays import Display, Say
from gamepad_client.operator import Operator
from gamepad_client.picture import SIZE
from gamepad_client.run_report import RunReport
from gamepad_client.settings import Settings
from gamepad_client.shaping import Shaping
from gamepad_client.status import status_of
from ik_client.clear_way import KEPT
from ik_client.client import IKClient
from ik_client.devices import DeviceError, Devices
from ik_client.ending import come_to_rest
from ik_client.homing import Homing
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_client.pacer import Pacer
from ik_client.phase_lock import PhaseLock
from ik_client.rate_loop import RateLoop
from ik_client.rate_types import RateLaw
from ik_client.robot_end import RobotLink
from ik_client.start import SettingsError, await_state, info_for, trusting, writable
from ik_proto import Array, InfoReply

_WARM_UP = 120.0
"""How long the service may take to have its rate control compiled [s]."""

_TIMEOUT = 0.01
"""How long a tick waits for an answer [s]; where a tick is longer, half of it."""

_TITLE = "ik-gamepad"

_LOOK_FOR_PAD = 1.0
"""How long to look for a pad at the beginning [s]."""

_LIMITS = MotionLimits(velocity=3.0, acceleration=20.0, jerk=10_000.0)
"""Of the loop. The service's answers keep less acceleration, so they pass exactly and the hand keeps its path; where
none comes, the arms brake at all of it. The jerk bounds how they are brought to where the robot's end holds them."""

_INSET = 0.001
"""How far within its limits a joint is kept [rad]: as the robot's own end does. The service slows down before that."""


def run(settings: Settings, say: Say, *, terminal: bool, keep_going: Callable[[], bool]) -> RunReport:
    """Run until it is asked to end, or the operator ends it.

    Args:
        settings: What to run.
        say: Tells a person a line; the first is a line of JSON where the output is no terminal.
        terminal: Whether the output is one.
        keep_going: Asked before every tick.

    Returns:
        What was done; it has been written to the file that was asked for.

    Raises:
        ValueError: Options, devices or addresses cannot be used.
        IKError: Service or robot cannot be reached at the beginning.
    """
    keep = writable(settings.report)
    with contextlib.ExitStack() as stack:
        devices = stack.enter_context(_devices(settings))
        operator = _operator(settings, devices)
        _await_pad(settings, devices)
        access = settings.access.arguments()
        ca = Path(settings.access.ca) if settings.access.ca else None
        robot = stack.enter_context(RobotLink(settings.robot, token=access["token"], ssl=trusting(ca)))
        info = info_for(robot, settings.robot, settings.service, **access)
        home = settings.home_posture(info)
        _warm_up(settings, info, home, access, say if terminal else lambda _line: None)
        period = 1.0 / settings.rate
        client = stack.enter_context(IKClient(settings.service, timeout=max(_TIMEOUT, 0.5 * period), **access))
        loop = RateLoop(
            client,
            operator,
            robot,
            JointLimiter(len(info.joint_names), period, _LIMITS, lower=info.lower, upper=info.upper, inset=_INSET),
            law=_law(settings),
            homing=Homing(home, settings.home_gain, settings.home_speed),
        )
        await_state(robot)
        report = RunReport()
        stack.callback(keep, report.write)
        _welcome(settings, devices, info, say, terminal=terminal)
        display = Display(devices, say, terminal=terminal)
        stack.callback(display.close)
        pacer = Pacer(period)
        lock = PhaseLock(pacer, period, robot.welcome.period)
        _loop(loop, settings, operator, display, report, pacer, lock, keep_going)
        display.close()
        if settings.release:
            loop.release()
            given = robot.release()
            say("the robot has taken its arms back" if given else "the robot has not taken its arms back: it holds")
        else:
            say("the robot holds its arms where they are")
    return report


def _loop(
    loop: RateLoop,
    settings: Settings,
    operator: Operator,
    display: Display,
    report: RunReport,
    pacer: Pacer,
    lock: PhaseLock,
    keep_going: Callable[[], bool],
) -> None:
    def tick() -> None:
        done = loop.tick()
        if done.measured is not None:
            lock.follow(done.measured.time)
        for line in report.observe(done):
            display.say(line)
        display.show(lambda: status_of(done, operator, settings.layout, keyboard=settings.keyboard), done.time)

    while keep_going() and not operator.ended:
        pacer.wait()
        report.paced(pacer)
        tick()
    come_to_rest(loop, "ik-gamepad ends", tick, pacer)


def _devices(settings: Settings) -> Devices:
    """Devices with a window where there is a display; the keyboard needs one."""
    if settings.keyboard:
        try:
            return Devices(SIZE, _TITLE, settings.pads)
        except DeviceError as error:
            raise SettingsError(f"--keyboard needs a window: {error}; use a pad, or a desktop") from None
    if settings.window:
        with contextlib.suppress(DeviceError):  # What is wrong with the mappings is said below.
            return Devices(SIZE, _TITLE, settings.pads)
    return Devices(mappings=settings.pads)


def _operator(settings: Settings, devices: Devices) -> Operator:
    return Operator(
        devices,
        settings.layout,
        keyboard=settings.keyboard,
        speed=settings.speed,
        turn_speed=settings.turn_speed,
        shaping=Shaping(settings.dead_zone, settings.curve),
        frame=settings.frame,
    )


def _await_pad(settings: Settings, devices: Devices) -> None:
    """Look for a pad for a moment; later on it may come and go.

    Raises:
        SettingsError: There is none.
    """
    end = time.monotonic() + _LOOK_FOR_PAD
    while not settings.keyboard and not devices.pads:
        devices.pump()
        if time.monotonic() > end:
            raise SettingsError("no gamepad is there: plug one in (ik-gamepad --list shows them), or use --keyboard")
        time.sleep(0.01)


def _warm_up(settings: Settings, info: InfoReply, home: Array, access: dict[str, Any], say: Say) -> None:
    """Have the service load its rate control, which takes seconds where it has to be compiled; see if home is clear.

    Raises:
        SettingsError: It is not.
    """
    say(f"{settings.service} serves {info.robot}; its rate control gets ready")
    with IKClient(settings.service, timeout=_WARM_UP, **access) as asking:
        asking.velocity(np.zeros(6), np.zeros(6), home)
        measured = asking.clearance(home[None])
    if measured.clearance is not None and measured.nearest is not None and measured.clearance[0] < KEPT:
        one, other = measured.nearest
        raise SettingsError(
            f"--home {settings.home}: {one} and {other} would be {1e3 * measured.clearance[0]:.0f} mm apart there, and "
            f"the arms keep {1e3 * KEPT:.0f}: choose another posture"
        )


def _law(settings: Settings) -> RateLaw:
    held = not settings.free
    return RateLaw(
        law=settings.law,
        hold=(held, held),
        damping=settings.damping,
        max_speed=settings.max_speed,
        max_acceleration=settings.max_acceleration,
        posture_gain=settings.posture_gain,
        left_bounds=settings.left_bounds(),
        right_bounds=settings.right_bounds(),
    )


def _welcome(settings: Settings, devices: Devices, info: InfoReply, say: Say, *, terminal: bool) -> None:
    """Tell what is used, and how the arms are made to move."""
    device = "keyboard" if settings.keyboard else devices.pads[0].name
    if not terminal:
        say(json.dumps({"device": device, "robot": info.robot, "rate": settings.rate, "window": devices.has_window}))
        return
    say(f"{device} moves {info.robot} at {settings.robot}; Ctrl-C ends it, and the robot holds")
