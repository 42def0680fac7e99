"""What the loop did last, for the HUD. The loop writes, the server reads; neither waits for the other.

The note tells one thing, the gravest: what is wrong with the robot or the loop, else why there is no picture.
"""

from collections.abc import Callable

import numpy as np

from ik_client.state_machine import ArmState
from ik_client.tick_report import TickReport
from ik_proto import Status
from xr_client.messages import ArmHud, Hud
from xr_client.stages import Stages

FAR_FROM_TARGET = 0.02
"""Distance of a wrist from its target that a person is warned of [m]."""

_SIDES = ("left", "right")


class HudBoard:
    """Keeps the latest tick as a HUD shows it."""

    def __init__(self, stages: Stages | None = None) -> None:
        """Start without a tick.

        Args:
            stages: Latencies to show; None shows those of a tick only.
        """
        self._stages = stages
        self._no_picture: Callable[[], str] = str
        self._states = [ArmState.DISARMED, ArmState.DISARMED]
        self._changes = [0, 0]
        self._latest: TickReport | None = None

    @property
    def robot_ready(self) -> bool:
        """Whether the robot would follow, as of the latest tick."""
        measured = self._latest.measured if self._latest else None
        return measured is not None and measured.ready

    def explain_pictures(self, fault: Callable[[], str]) -> None:
        """Show why there is no picture.

        Args:
            fault: Says why, in one line; empty where there is one, or none is wanted. Asked whenever a HUD is made.
        """
        self._no_picture = fault

    def observe(self, report: TickReport) -> None:
        """Take a tick."""
        for side, arm in enumerate(report.arms):
            if arm.state is not self._states[side]:
                self._states[side] = arm.state
                self._changes[side] += 1
        self._latest = report

    def hud(self) -> Hud:
        """What to show now."""
        report = self._latest
        if report is None:
            return Hud(note="the loop has not begun", latency_ms=self._latencies(None))
        left, right = (self._arm(report, side) for side in range(len(_SIDES)))
        robot = report.measured
        if robot is None:
            note = report.reason or "the robot cannot be read"
        elif robot.note and not robot.following:
            note = f"robot: {robot.note}"
        else:
            note = report.reason if report.fault or any(arm.state is ArmState.ACTIVE for arm in report.arms) else ""
        return Hud(left, right, note or self._no_picture(), self._latencies(report))

    def _arm(self, report: TickReport, side: int) -> ArmHud:
        arm = report.arms[side]
        active = arm.state is ArmState.ACTIVE
        distance = _number(report.position_error, side) if active else None
        angle = _number(report.rotation_error, side) if active else None
        return ArmHud(
            state=str(arm.state),
            reason=arm.reason,
            position_error_mm=None if distance is None else round(1e3 * distance, 2),
            rotation_error_deg=None if angle is None else round(float(np.degrees(angle)), 2),
            warning=_warning(report, distance) if active else "",
            changes=self._changes[side],
        )

    def _latencies(self, report: TickReport | None) -> dict[str, float | None]:
        """Stages of late, and the latest solve, rounded to 10 us [ms]."""
        stages = self._stages.recent() if self._stages else {}
        solve_us = report.solve_us if report else None
        stages["solve"] = None if solve_us is None else 1e-3 * solve_us
        return {name: None if value is None else round(value, 2) for name, value in stages.items()}


def _number(errors: np.ndarray | None, side: int) -> float | None:
    if errors is None or not np.isfinite(errors[side]):
        return None
    return float(errors[side])


def _warning(report: TickReport, distance: float | None) -> str:
    if distance is not None and distance > FAR_FROM_TARGET:
        edge = "at the edge of what the arm reaches" if report.status is Status.UNREACHABLE else "away from the hand"
        return f"{1e2 * distance:.0f} cm {edge}"
    return ""
