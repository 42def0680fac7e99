"""What `ik-camera run` is asked to do."""

import math
from dataclasses import dataclass, field
from pathlib import Path

from camera_client.approach import SLOW
from ik_client.access_options import AccessFiles
from ik_client.start import SettingsError

FASTEST_JOINT = 3.0
"""Largest velocity of a joint's command [rad/s]."""
STEEPEST = 60.0
"""A camera that looks further down than this does not see a person as the pose model expects one [deg]."""
STARTS = ("home", "operator")


@dataclass(frozen=True, slots=True)
class Settings:
    """What to run.

    Attributes:
        service: Address of the IK service.
        robot: Address of the robot's end.
        access: What a service or robot that asks is shown.
        source: Where frames come from, as `source.open_source` takes it.
        replay: A recording to play instead; its own switch plays along, unless one is given.
        replay_speed: How many times faster than it was a recording is played.
        field_of_view: Of a webcam, from the left to the right edge [deg]; None for a usual one.
        model: Name or path of the pose model.
        user: Whose calibration to use; None for that of nobody.
        tilt: How far the camera looks down [deg]; None takes it from the calibration, or level.
        enable: Switches of which one must be held.
        mirror: Whether the robot is the operator's mirror image.
        start: "home" goes home before it comes to the operator, "operator" does not.
        speed: Largest velocity of a joint [rad/s].
        start_speed: The same until an arm follows for the first time after it was disarmed [rad/s].
        preview: Show a window, where there is a display.
        report: JSON file to write what the run did and how long its stages took to.
        release: At the end, have the robot take its arms back; else it holds them.
    """

    service: str = "tcp://127.0.0.1:12345"
    robot: str = "tcp://127.0.0.1:12346"
    access: AccessFiles = field(default_factory=AccessFiles)
    source: str = "oak"
    replay: Path | None = None
    replay_speed: float = 1.0
    field_of_view: float | None = None
    model: str = "full"
    user: str | None = None
    tilt: float | None = None
    enable: tuple[str, ...] = ()
    mirror: bool = False
    start: str = "home"
    speed: float = FASTEST_JOINT
    start_speed: float = SLOW
    preview: bool = True
    report: Path | None = None
    release: bool = False

    def __post_init__(self) -> None:
        """Check what contradicts itself.

        Raises:
            SettingsError: One line that says what.
        """
        if self.start not in STARTS:
            raise SettingsError(f"--start {self.start}: choose one of {', '.join(STARTS)}")
        if not 0.0 < self.speed <= 10.0:
            raise SettingsError(f"--speed {self.speed:g}: must be above 0 and at most 10 rad/s")
        if not 0.0 < self.start_speed <= self.speed:
            raise SettingsError(f"--start-speed {self.start_speed:g}: must be above 0 and at most --speed, in rad/s")
        if not 0.1 <= self.replay_speed <= 10.0:
            raise SettingsError(f"--replay-speed {self.replay_speed:g}: must be from 0.1 to 10")
        if self.tilt is not None and not abs(self.tilt) <= STEEPEST:
            raise SettingsError(f"--tilt {self.tilt:g}: must be from -{STEEPEST:g} to {STEEPEST:g} degrees")
        if self.field_of_view is not None and not 20.0 <= self.field_of_view <= 150.0:
            raise SettingsError(f"--fov {self.field_of_view:g}: must be from 20 to 150 degrees")

    @property
    def what(self) -> str:
        """What to open, for `source.open_source`."""
        return self.source if self.replay is None else str(self.replay)

    @property
    def field_of_view_rad(self) -> float | None:
        """The field of view [rad]."""
        return None if self.field_of_view is None else math.radians(self.field_of_view)
