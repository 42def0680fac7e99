"""Shoulders, elbows and wrists of a robot at its zero posture, read from its own description (MJCF)."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np

from camera_client.scaling import RobotArms
from ik_proto import Array
from ik_proto.robots import ArmDescription, RobotDescription, RobotError


def robot_arms(description: RobotDescription) -> RobotArms:
    """What scaling needs to know of a robot.

    The shoulder is taken at the second joint of an arm: the first one only turns it, the third one is along the upper
    arm. The lengths are means of both arms, which are alike but for rounding.

    Args:
        description: The robot's; its model is an MJCF file whose orientations, if any, are quaternions.

    Returns:
        Its arms with a straight waist.

    Raises:
        RobotError: The model cannot be read, or lacks a joint that it should have.
    """
    try:
        poses = dict(_joints(ET.parse(description.model).getroot(), description.base))
        shoulders, elbows, wrists, first = np.array([_points(arm, poses) for arm in description.arms]).swapaxes(0, 1)
    except KeyError as error:
        raise RobotError(description.model, f"has no joint or body {error}") from None
    except (OSError, ET.ParseError, ValueError) as error:
        raise RobotError(description.model, f"is no MJCF model that ik-camera can read ({error})") from None
    return RobotArms(
        shoulders=shoulders,
        upper=float(np.linalg.norm(elbows - shoulders, axis=1).mean()),
        fore=float(np.linalg.norm(wrists - elbows, axis=1).mean()),
        hint_origins=first,
    )


def _points(arm: ArmDescription, poses: dict[str, Array]) -> list[Array]:
    """Shoulder, elbow, wrist and first joint [m]."""
    T_wrist = poses[arm.wrist.joint]
    elbow = poses[arm.elbow or arm.joints[3]]
    wrist = T_wrist[:3, 3] + T_wrist[:3, :3] @ np.array(arm.wrist.xyz)
    return [poses[arm.joints[1]][:3, 3], elbow[:3, 3], wrist, poses[arm.joints[0]][:3, 3]]


def _joints(root: ET.Element, base: str) -> Iterator[tuple[str, Array]]:
    """Names of all joints above the base body, and where they are at zero, in the frame of that body."""
    body = next((body for body in root.iter("body") if body.get("name") == base), None)
    if body is None:
        raise KeyError(base)
    yield from _below(body, np.eye(4))


def _below(body: ET.Element, T: Array) -> Iterator[tuple[str, Array]]:
    for joint in body.findall("joint"):
        at = T.copy()
        at[:3, 3] += T[:3, :3] @ _vector(joint.get("pos", "0 0 0"))
        yield joint.get("name", ""), at
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
