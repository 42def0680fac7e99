"""Our robot as URDF and MJCF: the two arms on a fixed base, every other joint locked at zero, no shapes.

All peers so get the same chains and limits, each in the form it reads. Whether they read them alike is checked by the
driver, which compares forward kinematics.
"""

import json
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from benchmarks.peers.model import WRISTS, quaternion
from ik_proto.robots import RobotDescription
from ik_service.chains import ArmChain
from ik_service.robot import Robot

_INERTIA = 1e-3
"""Moment of inertia given to every link [kg m^2]; some readers insist on one, no solver here uses it."""


def write(folder: Path, description: RobotDescription, robot: Robot) -> None:
    """Write `model.json` and the model files that `model.Model` names.

    Args:
        folder: Existing folder.
        description: The robot's description.
        robot: The robot built from it.
    """
    velocity = [description.joints[name].velocity for name in robot.joint_names]
    facts = {
        "base": robot.base,
        "joint_names": robot.joint_names,
        "lower": robot.lower.tolist(),
        "upper": robot.upper.tolist(),
        "velocity": velocity,
    }
    (folder / "model.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    limits = dict(zip(robot.joint_names, velocity, strict=True))
    _save(folder / "arms.urdf", _urdf(robot, robot.arms, limits))
    _save(folder / "arms.xml", _mjcf(robot))
    for arm in robot.arms:
        _save(folder / f"{arm.side}.urdf", _urdf(robot, (arm,), limits))


def wrist_name(arm: ArmChain) -> str:
    """Name of the frame that an arm's targets are for."""
    return WRISTS[arm.side == "right"]


def _urdf(robot: Robot, arms: Iterable[ArmChain], velocity: dict[str, float]) -> Element:
    root = Element("robot", name=robot.name)
    SubElement(root, "link", name=robot.base)
    for arm in arms:
        links = [robot.base, *(_link(name) for name in arm.joint_names)]
        for i, (parent, child) in enumerate(pairwise(links)):
            name = arm.joint_names[i]
            link = SubElement(root, "link", name=child)
            inertial = SubElement(link, "inertial")
            SubElement(inertial, "origin", xyz=_text(arm.centers[i]), rpy="0 0 0")
            SubElement(inertial, "mass", value=repr(float(arm.masses[i])))
            zero = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
            SubElement(inertial, "inertia", {key: repr(_INERTIA) for key in ("ixx", "iyy", "izz")} | zero)
            joint = _joint(root, name, "revolute", parent, child, arm.placements[i])
            SubElement(joint, "axis", xyz=_text(arm.axes[i]))
            bounds = {"lower": repr(float(arm.lower[i])), "upper": repr(float(arm.upper[i]))}
            SubElement(joint, "limit", bounds | {"effort": "100", "velocity": repr(float(velocity[name]))})
        SubElement(root, "link", name=wrist_name(arm))
        _joint(root, f"{wrist_name(arm)}_joint", "fixed", links[-1], wrist_name(arm), arm.T_last_wrist)
    return root


def _joint(root: Element, name: str, kind: str, parent: str, child: str, placement: np.ndarray) -> Element:
    joint = SubElement(root, "joint", name=name, type=kind)
    rpy = pin.rpy.matrixToRpy(placement[:3, :3])
    SubElement(joint, "origin", xyz=_text(placement[:3, 3]), rpy=_text(rpy))
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    return joint


def _mjcf(robot: Robot) -> Element:
    root = Element("mujoco", model=robot.name)
    SubElement(root, "compiler", angle="radian", autolimits="true")
    world = SubElement(root, "worldbody")
    for arm in robot.arms:
        body = world
        for i, name in enumerate(arm.joint_names):
            body = SubElement(body, "body", {"name": _link(name)} | _pose(arm.placements[i]))
            moments = _text(np.full(3, _INERTIA))
            mass = repr(float(arm.masses[i]))
            SubElement(body, "inertial", pos=_text(arm.centers[i]), mass=mass, diaginertia=moments)
            bounds = _text((arm.lower[i], arm.upper[i]))
            SubElement(body, "joint", name=name, type="hinge", axis=_text(arm.axes[i]), range=bounds)
        SubElement(body, "site", {"name": wrist_name(arm)} | _pose(arm.T_last_wrist))
    return root


def _pose(T: np.ndarray) -> dict[str, str]:
    return {"pos": _text(T[:3, 3]), "quat": _text(quaternion(T[:3, :3]))}


def _link(joint: str) -> str:
    return f"{joint.removesuffix('_joint')}_link"


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _save(path: Path, root: Element) -> None:
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(path, encoding="unicode")
