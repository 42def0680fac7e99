"""What is shown to the operator: each arm and why it holds, the switch, the operator, what the camera sees.

The loop's thread puts in its ticks, whoever shows asks. Everything is replaced as a whole.
"""

from dataclasses import dataclass

from camera_client.approach import Approach
from camera_client.stages import Stages
from camera_client.tracker import CameraTracker, Look
from ik_client.engagement import ArmStep
from ik_client.gate import Verdict
from ik_client.state_machine import ArmState
from ik_client.tick_report import TickReport


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """All of it at a time.

    Attributes:
        look: The latest look; None before the first.
        arms: A line for the left and for the right arm of the robot.
        states: Their states.
        switch: Whether the hold-to-run switch is held; None where that is not known.
        operator: Who is followed, in a line.
        trouble: What is wrong that a person should know, in a line; empty where nothing is.
        latency_ms: What the stages took of late [ms]; None where there is no telling.
    """

    look: Look | None
    arms: tuple[str, str]
    states: tuple[ArmState, ArmState]
    switch: bool | None
    operator: str
    trouble: str
    latency_ms: dict[str, float | None]


class Board:
    """Puts it together."""

    def __init__(self, tracker: CameraTracker, stages: Stages, approaches: tuple[Approach, Approach]) -> None:
        """Start before the first tick.

        Args:
            tracker: Has the latest look.
            stages: Have the latencies.
            approaches: Of the left and of the right arm.
        """
        self._tracker, self._stages, self._approaches = tracker, stages, approaches
        self._tick: TickReport | None = None

    def observe(self, tick: TickReport) -> None:
        """Take a tick."""
        self._tick = tick

    @property
    def robot_ready(self) -> bool:
        """Whether the robot's end would follow."""
        measured = self._tick.measured if self._tick else None
        return measured is not None and measured.ready

    def look(self, now: float) -> Shown:
        """What to show.

        Args:
            now: The time [s], that of the loop's clock.
        """
        tick, look = self._tick, self._tracker.latest
        words, states = ("not started", "not started"), (ArmState.DISARMED, ArmState.DISARMED)
        if tick is not None:
            left, right = tick.arms
            words = self._words(0, left, now), self._words(1, right, now)
            states = left.state, right.state
        return Shown(
            look, words, states, self._tracker.held(now), _operator(look), self._trouble(now), self._stages.recent()
        )

    def _words(self, side: int, step: ArmStep, now: float) -> str:
        if step.state is ArmState.ACTIVE:
            return self._approaches[side].stage.value
        if step.verdict is not Verdict.OK:
            return f"{step.state}: {self._note(side, now) or step.reason}"
        if step.state is ArmState.DISARMED:
            return f"{step.state}: {step.reason}; let go and press to begin"
        return f"{step.state}: {step.reason}"

    def _note(self, side: int, now: float) -> str:
        """Why an arm is not seen; empty where it is."""
        look = self._tracker.latest
        trouble = self._tracker.trouble(now)
        if trouble or look is None or look.estimate is None:
            return trouble
        seen = look.estimate.tracked[1 - side if self._tracker.mirror else side]
        return "" if seen else look.estimate.note

    def _trouble(self, now: float) -> str:
        if self._tick is not None and not self.robot_ready:
            measured = self._tick.measured
            return f"the robot: {measured.note or 'not ready'}" if measured else "the robot is silent"
        seen = self._tracker.trouble(now)
        if seen:
            return seen
        if self._tick is not None and self._tick.reason and ArmState.ACTIVE in (a.state for a in self._tick.arms):
            return self._tick.reason
        return ""


def _operator(look: Look | None) -> str:
    if look is None or look.estimate is None:
        return "nobody yet"
    if look.estimate.note.startswith("somebody else"):
        return f"keeps to the operator; somebody else was seen {look.refused} times"
    return "in view" if look.estimate.tracked.any() else "out of view"
