"""One run from beginning to end: robot, client, loop, a window or none, report, pictures.

Both commands are built on it.
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.live import Live

from ik_client import IKClient, Limiter, StepLimiter, TeleopLoop, WeightedMovingFilter
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_proto.robots import RobotDescription, load_description
from sim_client.arms import ArmKinematics
from sim_client.events import Announcer
from sim_client.live import LiveTable
from sim_client.motion import RecordedMotion
from sim_client.paths import ScriptedPath
from sim_client.pictures import write_pictures
from sim_client.realtime import Observer, Runner
from sim_client.report import RunReport, report_lines, report_table, summarise
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.settings import SCRIPT_DURATION, Settings, SettingsError
from sim_client.sources import Approach, Markers, Motion, ScriptedOperator, scripted_arm
from sim_client.target_display import TargetDisplay
from sim_client.trace import Trace
from sim_client.window import Window, display_fault

START_TIME = 0.1
"""How long it takes to grip, and to align, once the robot's end is ready [s]."""

_INFO_TIMEOUT = 2.0


def run_session(settings: Settings, console: Console, extra: Sequence[Observer] = ()) -> RunReport:
    """Run, report, render.

    Args:
        settings: What to run.
        console: Where to speak; a live table is drawn if it is a terminal.
        extra: Further observers, called last.

    Returns:
        The report, after it was printed and written.

    Raises:
        SettingsError: The service serves another robot, or dragging was asked for without a display.
        RobotError: The robot's description or model cannot be used.
        MotionError: The motion file cannot be played.
        ValueError: There is no such path, or the address is none.
        IKError: The service cannot be reached at the beginning.
    """

    def say(line: str) -> None:
        console.print(line, markup=False, highlight=False, soft_wrap=True)

    description = load_description(settings.robot)
    robot = SimRobot(description, ramp=settings.ramp)
    trace = Trace()
    with contextlib.ExitStack() as stack:
        client = stack.enter_context(_connect(settings, description))
        announcer = Announcer(say, client.boot_id)
        window = _open_window(settings, robot, say)
        arms = ArmKinematics(description)
        motion = _motion(settings, robot, arms)
        operator = ScriptedOperator(motion, lambda: robot.read().ready)
        observers: list[Observer] = [operator, trace, announcer]
        if not settings.drag:
            observers.append(TargetDisplay(robot))
        if window:
            stack.callback(window.close)
            observers.append(window)
        if console.is_terminal:
            observers.append(LiveTable(stack.enter_context(Live(console=console, auto_refresh=False, transient=True))))
        loop = TeleopLoop(
            client,
            operator,
            robot,
            _limiter(settings, arms),
            arms=(scripted_arm(), scripted_arm()),
            smoothing=WeightedMovingFilter() if settings.smooth else None,
            feed_forward=settings.feed_forward,
            period=CONTROL_PERIOD,
        )
        whole = None if motion.length is None else motion.length + settings.ramp + START_TIME
        duration = settings.duration or whole or (None if window else SCRIPT_DURATION)
        runner = Runner(loop, robot, [*observers, *extra])
        follows = f"{description.name} follows {_name_of(settings)} through {settings.url}; Ctrl-C ends the run"
        pace = runner.run(duration, window.is_open if window else lambda: True, announce=lambda: say(follows))
    report = summarise(
        trace,
        pace,
        ticks_without_command=robot.ticks_without_command,
        events=announcer.lines,
        settings={name: str(value) if isinstance(value, Path) else value for name, value in asdict(settings).items()},
    )
    console.print(report_table(report))
    for line in report_lines(report):
        say(line)
    if settings.report:
        report.write(settings.report)
        say(f"wrote {settings.report}")
    write_pictures(settings, description, list(trace), console, say)
    return report


def _connect(settings: Settings, description: RobotDescription) -> IKClient:
    """A client with the loop's short timeout, of a service that serves this very robot."""
    access = settings.access.arguments()
    with IKClient(settings.url, timeout=_INFO_TIMEOUT, **access) as asking:
        info = asking.info()
    if tuple(info.joint_names) != description.arm_joints:
        raise SettingsError(
            f"{settings.url} serves robot {info.robot!r} with other arm joints than {description.name!r}; "
            "start both with the same --robot"
        )
    return IKClient(settings.url, timeout=settings.timeout, **access)


def _open_window(settings: Settings, robot: SimRobot, say: Callable[[str], None]) -> Window | None:
    if settings.headless:
        return None
    fault = display_fault()
    if fault is None:
        return Window(robot)
    if settings.drag:
        raise SettingsError(f"--drag needs a window: {fault}")
    say(f"{fault}; running headless")
    return None


def _name_of(settings: Settings) -> str:
    """What the targets come from, in words."""
    if settings.drag:
        return "the dragged markers"
    return f"the recording {settings.motion.name}" if settings.motion else f"the path '{settings.path}'"


def _motion(settings: Settings, robot: SimRobot, arms: ArmKinematics) -> Motion:
    """What the operator's hands do."""
    if settings.drag:
        return Markers(robot)
    motion = RecordedMotion(settings.motion, arms) if settings.motion else ScriptedPath(settings.path, arms)
    return Approach(motion, robot.wrists())


def _limiter(settings: Settings, arms: ArmKinematics) -> Limiter:
    """The seeds' clip where a step was given, else bounds of velocity, acceleration and jerk."""
    if settings.max_step is not None:
        return StepLimiter(settings.max_step)
    limits = MotionLimits(settings.max_velocity)
    return JointLimiter(len(arms.joint_names), CONTROL_PERIOD, limits, lower=arms.lower, upper=arms.upper)
