"""Capsule distances of the G1 by other people's code: coal in Pinocchio's geometry model, and MuJoCo.

Both place the capsules from the text of the description themselves, on the whole robot with its waist bent, so that
placement is checked along with distance.
"""

import importlib
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
import pinocchio as pin

from ik_proto.robots import CapsuleDescription, RobotDescription

coal = importlib.import_module("coal")  # Part of Pinocchio's wheel, without type stubs.


def coal_capsule(start: np.ndarray, end: np.ndarray, radius: float) -> tuple[object, np.ndarray, np.ndarray]:
    """A capsule of coal, which lies along z, with the rotation and position of its middle."""
    length = float(np.linalg.norm(end - start))
    z = (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return coal.Capsule(radius, length), np.column_stack([x, np.cross(z, x), z]), (start + end) / 2.0


def coal_distance(a: Sequence[np.ndarray], b: Sequence[np.ndarray], radius: float = 1e-3) -> float:
    """Distance of two segments, each its two ends, by coal."""
    shapes = []
    for start, end in (a, b):
        shape, R, p = coal_capsule(np.asarray(start), np.asarray(end), radius)
        shapes += [shape, coal.Transform3s(R, p)]
    return coal.distance(*shapes, coal.DistanceRequest(), coal.DistanceResult()) + 2.0 * radius


class PinocchioScene:
    """The robot in Pinocchio, its capsules in coal."""

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        self.model = pin.buildModelFromMJCF(str(description.model))
        self.data, geometry = self.model.createData(), pin.GeometryModel()
        for capsule in description.collision.capsules:
            shape, R, p = coal_capsule(np.array(capsule.start), np.array(capsule.end), capsule.radius)
            joint, T = self._body(capsule)
            geometry.addGeometryObject(pin.GeometryObject(capsule.name, joint, T * pin.SE3(R, p), shape))
        self.geometry = geometry

    def _body(self, capsule: CapsuleDescription) -> tuple[int, pin.SE3]:
        if self.model.existJointName(capsule.body):
            return self.model.getJointId(capsule.body), pin.SE3.Identity()
        frame = self.model.frames[self.model.getFrameId(capsule.body)]
        return frame.parentJoint, frame.placement

    def distances(self, q: np.ndarray, waist: np.ndarray, pairs: Sequence[tuple[str, str]]) -> np.ndarray:
        """Distances of pairs named by their capsules [m]; the legs are straight."""
        self.geometry.removeAllCollisionPairs()
        for pair in pairs:
            self.geometry.addCollisionPair(pin.CollisionPair(*map(self.geometry.getGeometryId, pair)))
        data, full = self.geometry.createData(), pin.neutral(self.model)
        for name, value in self._joints(q, waist):
            full[self.model.joints[self.model.getJointId(name)].idx_q] = value
        pin.computeDistances(self.model, self.data, self.geometry, data, full)
        return np.array([result.min_distance for result in data.distanceResults])

    def _joints(self, q: np.ndarray, waist: np.ndarray) -> Iterator[tuple[str, float]]:
        yield from zip(self.description.arm_joints + self.description.waist, np.append(q, waist), strict=True)


class MujocoScene:
    """The robot and its capsules in MuJoCo."""

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        spec = mujoco.MjSpec.from_file(str(description.model))
        for capsule in description.collision.capsules:
            joint = spec.joint(capsule.body)
            body = joint.parent if joint else spec.body(capsule.body)
            body.add_geom(
                name=f"capsule:{capsule.name}",
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[*capsule.start, *capsule.end],
                size=[capsule.radius, 0.0, 0.0],
            )
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)

    def distances(self, q: np.ndarray, waist: np.ndarray, pairs: Sequence[tuple[str, str]]) -> np.ndarray:
        """Distances of pairs named by their capsules [m]; the legs are straight."""
        for name, value in zip(self.description.arm_joints + self.description.waist, np.append(q, waist), strict=True):
            self.data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(self.model, self.data)
        geoms = [[self.model.geom(f"capsule:{name}").id for name in pair] for pair in pairs]
        return np.array([mujoco.mj_geomDistance(self.model, self.data, a, b, 10.0, np.zeros(6)) for a, b in geoms])
