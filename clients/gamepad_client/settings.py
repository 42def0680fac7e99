"""What `ik-gamepad` is asked to do."""

import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gamepad_client.layout import Layout
from ik_client.access_options import AccessFiles
from ik_client.start import SettingsError
from ik_proto import Array, Frame, InfoReply, Law
from ik_proto.limits import DEFAULT_ACCELERATION, DEFAULT_DAMPING, DEFAULT_POSTURE_GAIN, DEFAULT_SPEED

DOCUMENT_BOUNDS = "0.2:0.4,0:0.3,0.1:0.5"
"""The workspace of the published rate control, of the left hand: x, y, z [m]."""

_RANGES: dict[str, tuple[float, float]] = {
    "rate": (50.0, 400.0),
    "speed": (0.01, 1.5),
    "turn_speed": (0.01, 6.0),
    "dead_zone": (0.0, 0.9),
    "curve": (0.2, 5.0),
    "damping": (1e-3, 1.0),
    "max_speed": (0.01, 2.8),
    "max_acceleration": (0.1, 18.0),
    "posture_gain": (0.0, 100.0),
    "home_gain": (0.1, 20.0),
    "home_speed": (0.01, 2.0),
}


@dataclass(frozen=True, slots=True)
class Settings:
    """What to run.

    Attributes:
        service: Address of the IK service.
        robot: Address of the robot's end.
        access: Where the credentials are.
        rate: Ticks of the loop in a second [Hz].
        speed: Of a hand, with the stick at its edge [m/s].
        turn_speed: The same of turning [rad/s].
        dead_zone: Way of a stick that counts as none, 0 to 1.
        curve: Exponent of a stick's response.
        frame: Along whose axes the hands move at the beginning.
        law: How twists become joint velocities.
        free: Leave the hands' orientation free: move them only.
        damping: Of the fixed law, and the largest of the adaptive one.
        max_speed: Largest speed of a joint [rad/s].
        max_acceleration: Largest change of a joint's speed [rad/s^2].
        posture_gain: Share of the way to the middle of the joints' ranges that is made in a second, where the hands
            leave the choice [1/s].
        bounds: Workspace of the left hand, X0:X1,Y0:Y1,Z0:Z1 [m]; the right hand's is its mirror image. Empty for none.
        home: "zeros", or a TOML file with joints by name [rad].
        home_gain: Share of the rest of the way home that is made in a second [1/s].
        home_speed: Largest speed of a joint on the way home [rad/s].
        hold: The hold-to-run switch; empty for the layout's.
        layout: Which control does what.
        pads: File with mappings for SDL; None for none.
        keyboard: Whether keys of a window move the hands, not a pad.
        window: Whether to open a window where there is a display.
        report: JSON file to write what the run did; None for none.
        release: At the end, have the robot take its arms back; else it holds them.
    """

    service: str = "tcp://127.0.0.1:12345"
    robot: str = "tcp://127.0.0.1:12346"
    access: AccessFiles = field(default_factory=AccessFiles)
    rate: float = 250.0
    speed: float = 0.3
    turn_speed: float = 0.8
    dead_zone: float = 0.12
    curve: float = 1.7
    frame: Frame = "pelvis"
    law: Law = "adaptive"
    free: bool = False
    damping: float = DEFAULT_DAMPING
    max_speed: float = DEFAULT_SPEED
    max_acceleration: float = DEFAULT_ACCELERATION
    posture_gain: float = DEFAULT_POSTURE_GAIN
    bounds: str = ""
    home: str = "zeros"
    home_gain: float = 2.0
    home_speed: float = 0.5
    hold: str = ""
    layout: Layout = field(default_factory=Layout)
    pads: Path | None = None
    keyboard: bool = False
    window: bool = True
    report: Path | None = None
    release: bool = False

    def __post_init__(self) -> None:
        """Check what can be checked without a service.

        Raises:
            SettingsError: One line that says what is wrong.
        """
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise SettingsError(f"--{name.replace('_', '-')} {value:g}: must be from {low:g} to {high:g}")
        if self.keyboard and not self.window:
            raise SettingsError("--keyboard and --no-window do not go together: the keys are those of the window")
        self.left_bounds()

    def left_bounds(self) -> Array | None:
        """Smallest and largest coordinates of the left wrist, shape (2, 3) [m]; None for no bounds.

        Raises:
            SettingsError: They are none.
        """
        if not self.bounds:
            return None
        try:
            pairs = [[float(number) for number in pair.split(":")] for pair in self.bounds.split(",")]
            bounds = np.array(pairs, dtype=np.float64)
            if bounds.shape != (3, 2) or not np.isfinite(bounds).all() or not (bounds[:, 0] <= bounds[:, 1]).all():
                raise ValueError
        except ValueError:
            raise SettingsError(
                f"--bounds {self.bounds}: write smallest and largest x, y and z of the left wrist [m], as in "
                f"{DOCUMENT_BOUNDS}"
            ) from None
        return bounds.T

    def right_bounds(self) -> Array | None:
        """The mirror image, of the right wrist."""
        left = self.left_bounds()
        if left is None:
            return None
        right = left.copy()
        right[:, 1] = -left[::-1, 1]
        return right

    def home_posture(self, info: InfoReply) -> Array:
        """Where home is, shape (n,) [rad].

        Args:
            info: What the service says of the robot.

        Raises:
            SettingsError: The file is none, or home is out of the joints' limits.
        """
        q = np.zeros(len(info.joint_names))
        if self.home != "zeros":
            joints = _read_posture(Path(self.home))
            for name, value in joints.items():
                if name not in info.joint_names:
                    raise SettingsError(f"--home {self.home}: {info.robot} has no arm joint {name!r}")
                q[info.joint_names.index(name)] = value
        for name, value, low, high in zip(info.joint_names, q, info.lower, info.upper, strict=True):
            if not low <= value <= high:
                raise SettingsError(f"--home {self.home}: {name} is at {value:g} rad, beyond its {low:g} to {high:g}")
        return q


def _read_posture(path: Path) -> dict[str, float]:
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"--home {path}: cannot be read ({error.strerror}); or write zeros") from None
    except ValueError as error:
        raise SettingsError(f"--home {path}: is no TOML ({error})") from None
    for name, value in document.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise SettingsError(f"--home {path}: {name} must be an angle [rad], as in left_elbow_joint = 1.2")
    return {name: float(value) for name, value in document.items()}
