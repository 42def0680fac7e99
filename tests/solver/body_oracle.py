"""Capsule distances by Pinocchio and coal, from the description alone: shares no code with the service.

Every joint outside arms and waist is at zero. Pairs follow the rule of the description: all capsules of different
bodies against each other, less the ignored pairs and those that no arm joint moves.
"""

from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

from ik_proto.robots import RobotDescription

Pair = tuple[str, str]


class CapsuleOracle:
    """Measures a robot's capsules.

    Attributes:
        pairs: Names of the checked pairs, each sorted.
    """

    def __init__(self, description: RobotDescription) -> None:
        read = pin.buildModelFromUrdf if description.model.suffix == ".urdf" else pin.buildModelFromMJCF
        self._model = read(str(description.model))
        self._data = self._model.createData()
        self._geometry = pin.GeometryModel()
        for capsule in description.collision.capsules:
            start, end = np.array(capsule.start), np.array(capsule.end)
            length = float(np.linalg.norm(end - start))
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start).toRotationMatrix()
            frame = next(i for i, frame in enumerate(self._model.frames) if frame.name == capsule.body)
            parent = self._model.frames[frame].parentJoint
            placement = self._model.frames[frame].placement * pin.SE3(turn, (start + end) / 2.0)
            shape = coal.Capsule(capsule.radius, length)
            self._geometry.addGeometryObject(pin.GeometryObject(capsule.name, parent, frame, placement, shape))
        ignored = {frozenset(entry.pair) for entry in description.collision.ignored}
        self.pairs: list[Pair] = []
        for a, b in combinations(description.collision.capsules, 2):
            moved = any(self._moved_by(body, description.arm_joints) for body in (a.body, b.body))
            if moved and a.body != b.body and frozenset((a.name, b.name)) not in ignored:
                first, second = sorted((a.name, b.name))
                self.pairs.append((first, second))
                ids = [self._geometry.getGeometryId(name) for name in (first, second)]
                self._geometry.addCollisionPair(pin.CollisionPair(*ids))
        self._geometry_data = self._geometry.createData()
        self._arms = self._places(description.arm_joints)
        self._waist = self._places(description.waist)

    def distances(self, q: np.ndarray, waist: np.ndarray | None = None) -> np.ndarray:
        """Clearance of every pair [m], shape (pairs,), in the order of `pairs`."""
        self._measure(q, waist)
        return np.array([result.min_distance for result in self._geometry_data.distanceResults])

    def clearance(self, q: np.ndarray, waist: np.ndarray | None = None) -> float:
        """Smallest clearance [m]."""
        return self._geometry_data.distanceResults[self._measure(q, waist)].min_distance

    def nearest(self, q: np.ndarray, waist: np.ndarray | None = None) -> Pair:
        """The pair of the smallest clearance."""
        return self.pairs[self._measure(q, waist)]

    def along(self, q_start: np.ndarray, q_end: np.ndarray, waist: np.ndarray | None = None) -> float:
        """Smallest clearance on the straight joint path [m], sampled every 5 mrad of its fastest joint."""
        count = 2 + int(np.abs(q_end - q_start).max() / 0.005)
        return min(self.clearance(q, waist) for q in np.linspace(q_start, q_end, count))

    def _measure(self, q: np.ndarray, waist: np.ndarray | None) -> int:
        configuration = np.zeros(self._model.nq)
        configuration[self._arms] = q
        if waist is not None:
            configuration[self._waist] = waist
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._geometry_data, configuration)
        return int(pin.computeDistances(self._geometry, self._geometry_data))

    def _moved_by(self, body: str, joints: tuple[str, ...]) -> bool:
        frame = next(frame for frame in self._model.frames if frame.name == body)
        joint = frame.parentJoint
        while joint > 0:
            if self._model.names[joint] in joints:
                return True
            joint = self._model.parents[joint]
        return False

    def _places(self, joints: tuple[str, ...]) -> list[int]:
        return [self._model.joints[self._model.getJointId(name)].idx_q for name in joints]
