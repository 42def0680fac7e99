"""Shoulders, elbows and wrists of a robot, read from its own description (MJCF), for any posture of its waist.

Targets stand in the pelvis frame, and a waist that gives way takes the shoulders along. With an arm of 0.42 m that is
to be stretched, 2 cm make the difference between an elbow that is straight and one that is bent by 25 degrees.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from camera_client.scaling import RobotArms
from ik_client.rotation import rotation_matrix
from ik_proto import Array
from ik_proto.robots import ArmDescription, RobotDescription, RobotError


@dataclass(frozen=True)
class _Joint:
    """A joint at the zero posture.

    Attributes:
        T: Its pose in the frame of the base body, shape (4, 4) [m].
        axis: Its axis in its own frame, shape (3,).
    """

    T: Array
    axis: Array


@dataclass(frozen=True, slots=True, eq=False)
class RobotGeometry:
    """What scaling needs to know of a robot.

    Attributes:
        arms: With a straight waist.
        waist: Axis and a point on it of each waist joint from the pelvis up, shape (w, 2, 3) [m], pelvis frame.
    """

    arms: RobotArms
    waist: Array

    def bent(self, waist: Array | None) -> RobotArms:
        """The arms of the robot with a bent waist.

        Args:
            waist: Positions of its joints, shape (w,) [rad]; None for a straight one.
        """
        if waist is None or len(waist) != len(self.waist):
            return self.arms
        R, p = np.eye(3), np.zeros(3)
        # The product of exponentials: each joint turns what is above it about where its axis is at zero.
        for (axis, point), angle in zip(self.waist, waist.tolist(), strict=True):
            turn = rotation_matrix(angle * axis)
            R, p = R @ turn, p + R @ (point - turn @ point)
        arms = self.arms
        return replace(
            arms,
            shoulders=arms.shoulders @ R.T + p,
            hint_origins=arms.hint_origins @ R.T + p,
            axes=arms.axes @ R.T,
            R_waist=R,
            p_waist=p,
        )


def robot_geometry(description: RobotDescription) -> RobotGeometry:
    """Read a robot's description.

    The shoulder is taken at the second joint of an arm: the first one only turns it, the third one is along the upper
    arm. The lengths are means of both arms, which are alike but for rounding.

    Args:
        description: The robot's; its model is an MJCF file whose orientations, if any, are quaternions.

    Returns:
        Its geometry.

    Raises:
        RobotError: The model cannot be read, or lacks a joint that it should have.
    """
    try:
        joints = dict(_joints(ET.parse(description.model).getroot(), description.base))
        shoulders, elbows, wrists, first, axes = np.array(
            [_geometry(arm, joints) for arm in description.arms]
        ).swapaxes(0, 1)
        waist = [[joints[name].T[:3, :3] @ joints[name].axis, joints[name].T[:3, 3]] for name in description.waist]
    except KeyError as error:
        raise RobotError(description.model, f"has no joint or body {error}") from None
    except (OSError, ET.ParseError, ValueError) as error:
        raise RobotError(description.model, f"is no MJCF model that ik-camera can read ({error})") from None
    arms = RobotArms(
        shoulders=shoulders,
        upper=float(np.linalg.norm(elbows - shoulders, axis=1).mean()),
        fore=float(np.linalg.norm(wrists - elbows, axis=1).mean()),
        hint_origins=first,
        axes=axes,
        mount=np.array(waist[-1][1]) if waist else np.zeros(3),
    )
    return RobotGeometry(arms, np.array(waist).reshape(-1, 2, 3))


def _geometry(arm: ArmDescription, joints: dict[str, _Joint]) -> list[Array]:
    """Shoulder, elbow, wrist and first joint [m], and the axis of the first joint."""
    first, second, last = joints[arm.joints[0]], joints[arm.joints[1]], joints[arm.wrist.joint]
    wrist = last.T[:3, 3] + last.T[:3, :3] @ np.array(arm.wrist.xyz)
    elbow = joints[arm.elbow or arm.joints[3]].T[:3, 3]
    return [second.T[:3, 3], elbow, wrist, first.T[:3, 3], first.T[:3, :3] @ first.axis]


def _joints(root: ET.Element, base: str) -> Iterator[tuple[str, _Joint]]:
    """All joints above the base body by their names."""
    body = next((body for body in root.iter("body") if body.get("name") == base), None)
    if body is None:
        raise KeyError(base)
    yield from _below(body, np.eye(4))


def _below(body: ET.Element, T: Array) -> Iterator[tuple[str, _Joint]]:
    for joint in body.findall("joint"):
        at = T.copy()
        at[:3, 3] += T[:3, :3] @ _vector(joint.get("pos", "0 0 0"))
        yield joint.get("name", ""), _Joint(at, _vector(joint.get("axis", "0 0 1")))
    for child in body.findall("body"):
        if {"euler", "axisangle", "xyaxes", "zaxis"}.intersection(child.keys()):
            raise ValueError(f"body {child.get('name')} is not turned by a quaternion")
        T_child = np.eye(4)
        T_child[:3, :3] = _rotation(_vector(child.get("quat", "1 0 0 0")))
        T_child[:3, 3] = _vector(child.get("pos", "0 0 0"))
        yield from _below(child, T @ T_child)


def _vector(text: str) -> Array:
    return np.array([float(part) for part in text.split()])


def _rotation(wxyz: Array) -> Array:
    w, x, y, z = wxyz / math.hypot(*wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
