"""The numbers of a robot that ran alone: what its set-points and its joints did, seen at the robot."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ik_client.robot_end import EndState
from ik_proto import Array
from sim_client.robot import CONTROL_PERIOD, SimRobot


@dataclass(frozen=True, slots=True)
class RobotReport:
    """What a run showed. Motion is by differences between control ticks.

    Attributes:
        seconds: Simulated time [s].
        ticks: Control ticks.
        largest_step: Largest change of a joint's set-point in a tick [rad].
        largest_velocity: Of a joint's set-point [rad/s].
        largest_acceleration: Of a joint's set-point [rad/s^2].
        largest_measured_step: Largest change of a measured arm joint in a tick [rad].
        largest_measured_velocity: Of a measured arm joint [rad/s].
        largest_measured_acceleration: Of a measured arm joint [rad/s^2].
        step_while_disarmed: Largest change of a joint's set-point in a tick once the arms, not being followed, had the
            time to brake [rad].
        lowest_wrist: Lowest height of a wrist in the pelvis frame [m].
        lowest_pelvis: Lowest height of the pelvis in the world [m].
        holds: How often the arms held because a command was late.
        disarms: How often following ended without the operator's doing.
        takes: How often the arms were taken.
        releases: How often they were given back.
        commands: Commands that counted.
        dropped: Commands that did not, by the reason.
        state: The state at the end.
        weight: The weight at the end.
        link: What happened to connections and messages.
    """

    seconds: float
    ticks: int
    largest_step: float
    largest_velocity: float
    largest_acceleration: float
    largest_measured_step: float
    largest_measured_velocity: float
    largest_measured_acceleration: float
    step_while_disarmed: float
    lowest_wrist: float
    lowest_pelvis: float
    holds: int
    disarms: int
    takes: int
    releases: int
    commands: int
    dropped: dict[str, int]
    state: str
    weight: float
    link: dict[str, int]

    def write(self, path: Path) -> None:
        """Write as JSON; folders are made."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(asdict(self), indent=2) + "\n", encoding="utf-8")


class _Motion:
    """Largest differences of a vector between control ticks."""

    def __init__(self) -> None:
        self.step = self.acceleration = 0.0
        self.last_step = 0.0
        self._q: Array | None = None
        self._change: Array | None = None

    def observe(self, q: Array | None) -> None:
        """Take the next vector; None breaks the sequence off."""
        change = None if q is None or self._q is None else q - self._q
        self.last_step = 0.0 if change is None else float(np.abs(change).max())
        self.step = max(self.step, self.last_step)
        if change is not None and self._change is not None:
            bend = float(np.abs(change - self._change).max()) / CONTROL_PERIOD**2
            self.acceleration = max(self.acceleration, bend)
        self._q, self._change = q, change


class RobotRecord:
    """Takes in every control tick; keeps only what the report needs."""

    # Time to stop from full velocity, twice over [ticks].
    _BRAKING_TICKS = 20

    def __init__(self) -> None:
        """Start empty."""
        self._setpoint, self._measured = _Motion(), _Motion()
        self._quiet_ticks = 0
        self._step_while_disarmed = 0.0
        self._lowest_wrist = self._lowest_pelvis = np.inf

    def observe(self, robot: SimRobot) -> None:
        """Look at the robot after a tick."""
        state = robot.read()
        self._setpoint.observe(state.q_set)
        self._measured.observe(state.q)
        follows = robot.guard.state is EndState.FOLLOWING
        self._quiet_ticks = 0 if follows else self._quiet_ticks + 1
        if self._quiet_ticks > self._BRAKING_TICKS:
            self._step_while_disarmed = max(self._step_while_disarmed, self._setpoint.last_step)
        self._lowest_wrist = min(self._lowest_wrist, *(float(T[2, 3]) for T in robot.wrists()))
        self._lowest_pelvis = min(self._lowest_pelvis, float(robot.data.body(robot.description.base).xpos[2]))

    def report(self, robot: SimRobot, link: Mapping[str, int]) -> RobotReport:
        """Sum up.

        Args:
            robot: The robot, at the end.
            link: Its link's tally.
        """
        tally = robot.guard.tally
        return RobotReport(
            seconds=robot.time,
            ticks=robot.ticks,
            largest_step=self._setpoint.step,
            largest_velocity=self._setpoint.step / CONTROL_PERIOD,
            largest_acceleration=self._setpoint.acceleration,
            largest_measured_step=self._measured.step,
            largest_measured_velocity=self._measured.step / CONTROL_PERIOD,
            largest_measured_acceleration=self._measured.acceleration,
            step_while_disarmed=self._step_while_disarmed,
            lowest_wrist=self._lowest_wrist,
            lowest_pelvis=self._lowest_pelvis,
            holds=tally["holding"],
            disarms=tally["disarmed"],
            takes=tally["taking"],
            releases=tally["released"],
            commands=tally["accepted"],
            dropped={reason: tally[reason] for reason in ("busy", "old", "bad")},
            state=robot.guard.state.value,
            weight=robot.guard.weight,
            link=dict(link),
        )
