"""What is fitted to an operator, and how it is kept: one JSON file a user.

Limb lengths, where the hips are below the shoulders, and which way is up in the picture, which is the camera's tilt.
What no person looks like is refused, and says what to do.
"""

import json
import math
import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from camera_client.torso import level_rotation
from ik_proto import Array

_UPPER, _FORE, _TORSO = (0.18, 0.42), (0.15, 0.36), (0.30, 0.70)
"""Lengths that people have: upper arm, forearm, from between the shoulders to between the hips [m]."""
_FRONT = math.radians(15.0)
"""How far an operator may seem to be turned [rad]."""
_UNEQUAL = 0.12
"""Largest difference between left and right, over their mean."""
_USER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


class CalibrationError(ValueError):
    """An operator cannot be fitted, or a stored fit cannot be used; the message says what to do, in one line."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """An operator before a camera.

    Attributes:
        lengths: Of upper arm and forearm, left and right, shape (2, 2) [m].
        hips_below: From between the shoulders to between the hips, pelvis frame, shape (3,) [m].
        up_camera: Up, in the camera's optical frame, shape (3,).
        front: How far the front of the trunk seems turned of an operator who faces the camera [rad], see `trunk_plane`.
    """

    lengths: Array
    hips_below: Array
    up_camera: Array
    front: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what nobody looks like.

        Raises:
            CalibrationError: It says what is wrong.
        """
        for name, shape in (("lengths", (2, 2)), ("hips_below", (3,)), ("up_camera", (3,))):
            values = getattr(self, name)
            if values.shape != shape or not np.isfinite(values).all():
                raise CalibrationError(f"{name} are not {shape} finite numbers: calibrate again")
        if not abs(self.front) <= _FRONT:
            raise CalibrationError("you seem to be turned away: face the camera and hold a T pose again")
        if abs(math.hypot(*self.up_camera) - 1.0) > 1e-3:
            raise CalibrationError("up is no direction of length 1: calibrate again")
        for limb, name, (low, high) in ((0, "upper arm", _UPPER), (1, "forearm", _FORE)):
            left, right = self.lengths[:, limb].tolist()
            for side, value in (("left", left), ("right", right)):
                if not low <= value <= high:
                    raise CalibrationError(
                        f"the {side} {name} seems to be {value:.2f} m long: stand 2 to 4 m away, sleeves close to the "
                        "arms, and hold a T pose again"
                    )
            if abs(left - right) > _UNEQUAL * 0.5 * (left + right):
                raise CalibrationError(
                    f"the {name}s seem to differ, {left:.2f} m left and {right:.2f} m right: face the camera and hold "
                    "a T pose again"
                )
        if not _TORSO[0] <= -self.hips_below[2] <= _TORSO[1]:
            raise CalibrationError(
                f"the hips seem to be {-self.hips_below[2]:.2f} m below the shoulders: stand upright with the hips in "
                "view and hold a T pose again"
            )

    def level_rotation(self) -> Array:
        """Rotation from the optical frame to the upright frame before the camera, shape (3, 3)."""
        return level_rotation(self.up_camera)


TYPICAL = Calibration(
    lengths=np.array([[0.29, 0.25], [0.29, 0.25]]),
    hips_below=np.array([0.0, 0.0, -0.48]),
    up_camera=np.array([0.0, -1.0, 0.0]),
)
"""An adult before a level camera, for as long as nobody is calibrated."""


def default_folder() -> Path:
    """Where calibrations are kept: `$XDG_CONFIG_HOME/ik-camera`, else `~/.config/ik-camera`."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser() / "ik-camera"


def save(calibration: Calibration, user: str, folder: Path) -> Path:
    """Keep a calibration as `USER.json`, whole or not at all.

    Raises:
        CalibrationError: The name cannot be a file's.
        OSError: The folder cannot be written.
    """
    path = _path(user, folder)
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(
        {
            "lengths": calibration.lengths.tolist(),
            "hips_below": calibration.hips_below.tolist(),
            "up_camera": calibration.up_camera.tolist(),
            "front": calibration.front,
        },
        indent=2,
    )
    with tempfile.NamedTemporaryFile("w", dir=folder, suffix=".tmp", delete=False) as file:
        file.write(text + "\n")
    os.replace(file.name, path)
    return path


def load(user: str, folder: Path) -> Calibration:
    """Read a calibration.

    Raises:
        CalibrationError: There is none of this name, or it cannot be used.
    """
    path = _path(user, folder)
    try:
        content: Any = json.loads(path.read_bytes())
        return Calibration(
            np.array(content["lengths"], dtype=float),
            np.array(content["hips_below"], dtype=float),
            np.array(content["up_camera"], dtype=float),
            float(content["front"]),
        )
    except FileNotFoundError:
        raise CalibrationError(f"no calibration of {user} in {folder}: run ik-camera calibrate --user {user}") from None
    except CalibrationError as fault:
        raise CalibrationError(f"{path}: {fault}") from None
    except (OSError, KeyError, TypeError, ValueError):
        raise CalibrationError(f"{path} cannot be read: run ik-camera calibrate --user {user}") from None


def _path(user: str, folder: Path) -> Path:
    if not _USER.fullmatch(user):
        raise CalibrationError(f"{user!r} is no user name: use letters, digits, - and _, at most 64")
    return folder / f"{user}.json"
