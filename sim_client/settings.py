"""What a run of the simulator is made of: the options of the commands, checked."""

import math
from dataclasses import dataclass, field
from pathlib import Path

from ik_client.access_options import AccessFiles
from ik_client.robot_end.guard import RAMP
from sim_client.paths import DEFAULT_PATH
from sim_client.robot import CONTROL_PERIOD

MAX_VELOCITY = 3.0
"""Largest velocity of a joint's command [rad/s]."""

SOLVE_TIMEOUT = 0.010
"""How long a tick waits for the service [s]."""

SCRIPT_DURATION = 14.0
"""How long a scripted path runs without a window, unless told otherwise [s]."""


class SettingsError(ValueError):
    """Options that make no run: one line that says which, and what to do."""


@dataclass(frozen=True)
class Settings:
    """What to run.

    Attributes:
        url: Address of the service.
        robot: Name or path of the robot's description.
        path: Scripted path; used where neither `motion` nor `drag` is given.
        motion: Motion file to play instead.
        drag: Follow the markers dragged in the window instead.
        headless: Open no window.
        duration: Simulated time to run [s]; None: as long as the motion, `SCRIPT_DURATION` for a script, or until the
            window is closed.
        feed_forward: Add the gravity torque the service computes.
        smooth: Filter the answers as OpenWBT does.
        max_velocity: Largest velocity of a joint's command [rad/s].
        max_step: Largest step of a joint's command per tick, OpenWBT's clip, in place of bounds of velocity,
            acceleration and jerk [rad]; None for these.
        timeout: How long a tick waits for the service [s].
        ramp: How long the robot's end takes to hand its arms over, and to take them back [s].
        access: What a service that asks is shown.
        report: JSON file for the report.
        video: File for a film.
        still: File for a strip of stills.
        eyes: Folder for stereo pictures.
    """

    url: str
    robot: str = "g1"
    path: str = DEFAULT_PATH
    motion: Path | None = None
    drag: bool = False
    headless: bool = False
    duration: float | None = None
    feed_forward: bool = False
    smooth: bool = False
    max_velocity: float = MAX_VELOCITY
    max_step: float | None = None
    timeout: float = SOLVE_TIMEOUT
    ramp: float = RAMP
    access: AccessFiles = field(default_factory=AccessFiles)
    report: Path | None = None
    video: Path | None = None
    still: Path | None = None
    eyes: Path | None = None

    def __post_init__(self) -> None:
        """Check what the parts would find out too late.

        Raises:
            SettingsError: A number makes no sense, or the options contradict each other.
        """
        if not 0.0 < self.timeout < CONTROL_PERIOD:
            raise SettingsError(
                f"--timeout {self.timeout:g}: must be positive and less than a tick of {CONTROL_PERIOD:g} s, "
                "so that a dead service never stops the physics"
            )
        bounds = {
            "--max-velocity": self.max_velocity,
            "--max-step": self.max_step,
            "--ramp": self.ramp,
            "--duration": self.duration,
        }
        for name, value in bounds.items():
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise SettingsError(f"{name} {value:g}: must be a positive number")
        if self.drag and self.headless:
            raise SettingsError("--drag needs the window: leave out --headless")
        if self.video is not None and self.video.suffix.lower() not in (".mp4", ".mkv", ".mov"):
            raise SettingsError(f"--video {self.video}: the name must end in .mp4, .mkv or .mov")
