"""One run of `ik-camera`: a camera or a recording, the teleop loop, a service and a robot.

| thread     | does                                                                                     |
|------------|------------------------------------------------------------------------------------------|
| perception | frame ─> pose model ─> arms; the pose model works outside of Python's lock               |
| loop       | a tick at the robot's own rate: predict, judge, solve, limit, send                       |
| main       | switches, keys, window, words: SDL wants the main thread                                 |

Each hands on its latest only, so none waits for another, and none can hold another up.
"""

import contextlib
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from camera_client.approach import Approach, HomeFirst, PacedLimiter
from camera_client.board import Board, Shown
from camera_client.chain import Chain
from camera_client.clear_arms import ClearArms
from camera_client.cockpit import Cockpit, pause
from camera_client.loop_thread import LoopThread
from camera_client.perception import Perception
from camera_client.robot_arms import robot_geometry
from camera_client.run_report import RunReport
from camera_client.settings import Settings
from camera_client.setup import Say, calibration_of, detector_of, source_of, whose
from camera_client.stages import Stages
from camera_client.tracker import CameraTracker
from ik_client.absolute_clutch import ABSOLUTE_FALL
from ik_client.arm_joints import SIDES
from ik_client.authority import Authority
from ik_client.client import IKClient
from ik_client.ending import come_to_rest
from ik_client.engagement import ArmEngagement
from ik_client.gate import GateLimits, PoseGate
from ik_client.joint_limiter import MotionLimits
from ik_client.pacer import Pacer
from ik_client.robot_end import RobotLink
from ik_client.start import await_state, info_for, trusting, writable
from ik_client.steady_waist import SteadyWaist
from ik_client.teleop import TeleopLoop
from ik_proto import FkReply
from ik_proto.robots import load_description

GATE = GateLimits(max_age=0.2, min_interval=0.1)
"""Every tick has another prediction, but only a new frame corrects it: every 33 ms, or 100 ms on a busy machine. What
is no hand's motion the chain has refused or smoothed before."""
_FK_TIMEOUT = 2.0
_SWITCH_INTERVAL = 0.001
"""How long one thread may keep Python's lock from another one that wants it [s]: the loop's tick is 20 ms."""


def run(
    settings: Settings,
    say: Say,
    *,
    terminal: bool,
    keep_going: Callable[[], bool],
    watch: Callable[[Shown], None] | None = None,
) -> RunReport:
    """Run until it is asked to end, or the recording has.

    Args:
        settings: What to run.
        say: Tells a person a line; the first is a line of JSON where the output is no terminal.
        terminal: Whether the output is one.
        keep_going: Asked all the time.
        watch: Called with what is shown, as often as a window would be.

    Returns:
        What was done; it has been written to the file that was asked for.

    Raises:
        ValueError: Options, devices, sources, models or calibrations cannot be used.
        IKError: Service or robot cannot be reached at the beginning.
    """
    calibration, keep = calibration_of(settings), writable(settings.report)
    # Programs read the first line of the output.
    note: Say = say if terminal else lambda line: print(line, file=sys.stderr, flush=True)
    with contextlib.ExitStack() as stack:
        source = stack.enter_context(contextlib.closing(source_of(settings)))
        if not source.has_depth:
            note("this source has no depth: wrists will be about four times as far off as with a depth camera")
        detector = stack.enter_context(contextlib.closing(detector_of(settings.model, note)))
        access = settings.access.arguments()
        ca = Path(settings.access.ca) if settings.access.ca else None
        robot = stack.enter_context(RobotLink(settings.robot, token=access["token"], ssl=trusting(ca)))
        info = info_for(robot, settings.robot, settings.service, **access)
        description = load_description(robot.welcome.robot)
        period = robot.welcome.period
        with IKClient(settings.service, timeout=_FK_TIMEOUT, **access) as asking:
            home = asking.fk(np.array([description.joint(name).home for name in info.joint_names]))
        client = stack.enter_context(IKClient(settings.service, timeout=0.5 * period, **access))
        cockpit = stack.enter_context(
            Cockpit(
                settings.enable,
                own_switch=settings.replay is not None,
                window=settings.preview,
                title=f"ik-camera: {source.description}",
                terminal=terminal,
                watch=watch,
            )
        )
        approaches = _approaches(settings)
        geometry, waist = robot_geometry(description), SteadyWaist()
        tracker = CameraTracker(
            geometry.arms,
            cockpit.enable.held if cockpit.enable else None,
            approaches,
            lead=period,
            mirror=settings.mirror,
            clear=ClearArms(geometry.arms, description) if description.collision.capsules else None,
        )
        limits = MotionLimits(velocity=settings.speed)
        loop = TeleopLoop(
            client,
            tracker,
            robot,
            PacedLimiter(len(info.joint_names), period, limits, approaches, lower=info.lower, upper=info.upper),
            arms=_arms(approaches, home),
            feed_forward=True,
        )
        stages = Stages()
        perception = Perception(source, detector, Chain(calibration), tracker, stages)
        board = Board(tracker, stages, approaches)
        await_state(robot)
        about = {"source": source.description, "robot": description.name, "model": settings.model}
        report = RunReport(stages, tracker, perception, about)
        stack.callback(keep, report.write)
        say(f"{source.description}; {whose(settings)}; {cockpit.hint}" if terminal else json.dumps(about))

        def tick() -> list[str]:
            done = loop.tick()
            stages.observe(done, tracker.used)
            if done.measured is not None:
                tracker.robot = geometry.bent(waist.update(done.measured.waist, done.time))
            for approach in approaches:
                approach.observe(done)
            board.observe(done)
            changed, seen = report.observe(done), tracker.trouble(done.time)
            return [*changed, f"camera: {seen}"] if changed and seen else changed

        pacer = Pacer(period)

        def end(tick: Callable[[], None]) -> None:
            come_to_rest(loop, "ik-camera ends", tick, pacer)

        ticking = LoopThread(tick, end, pacer, report.paced, lambda: perception.finished)
        stack.callback(perception.close)
        stack.callback(ticking.close)
        sys.setswitchinterval(_SWITCH_INTERVAL)
        ticking.start()
        _attend(cockpit, ticking, perception, board, loop, approaches, keep_going)
        ticking.close()
        _farewell(settings, loop, robot, perception, cockpit)
    return report


def _attend(
    cockpit: Cockpit,
    ticking: LoopThread,
    perception: Perception,
    board: Board,
    loop: TeleopLoop,
    approaches: tuple[Approach, Approach],
    keep_going: Callable[[], bool],
) -> None:
    """What the main thread does until the run ends."""
    begun, fault = False, ""
    stages = tuple(approach.stage for approach in approaches)
    while keep_going() and ticking.alive and not cockpit.ended:
        if not begun and board.robot_ready:
            # A recording plays from here on: before, nobody would follow it.
            begun = True
            perception.start()
        if cockpit.attend(time.monotonic()):
            loop.stop("the next operator")
            perception.release_operator()
            cockpit.say("whoever is seen next is the operator")
        cockpit.show(lambda: board.look(time.monotonic()), time.monotonic())
        while ticking.lines:
            cockpit.say(ticking.lines.popleft())
        now = tuple(approach.stage for approach in approaches)
        for side, before, stage in zip(SIDES, stages, now, strict=True):
            if stage is not before:
                cockpit.say(f"{side} arm: {stage}")
        stages = now
        if perception.fault != fault:
            fault = perception.fault
            cockpit.say(f"camera: {fault or 'frames come again'}")
        pause()


def _farewell(settings: Settings, loop: TeleopLoop, robot: RobotLink, perception: Perception, cockpit: Cockpit) -> None:
    if perception.finished:
        cockpit.say(f"the source has ended{': ' if perception.fault else ''}{perception.fault}")
    if settings.release:
        loop.release()
        given = robot.release()
        cockpit.say("the robot has taken its arms back" if given else "the robot has not taken its arms back: it holds")
    else:
        cockpit.say("the robot holds its arms where they are")


def _approaches(settings: Settings) -> tuple[Approach, Approach]:
    slow, home_first = settings.start_speed / settings.speed, settings.start == "home"
    return Approach(0, slow, home_first=home_first), Approach(1, slow, home_first=home_first)


def _arms(approaches: tuple[Approach, Approach], home: FkReply) -> tuple[ArmEngagement, ArmEngagement]:
    """How the arms engage: at the operator's word, from home."""
    left, right = (
        ArmEngagement(gate=PoseGate(GATE), clutch=HomeFirst(approach, wrist), authority=Authority(fall=ABSOLUTE_FALL))
        for approach, wrist in zip(approaches, (home.left_wrist, home.right_wrist), strict=True)
    )
    return left, right
