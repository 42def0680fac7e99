"""Forearms kept out of the robot's body, before anything is asked for that the robot cannot do.

A robot is broader than the person it follows. Hands that rest at the person's thighs, pass close by the hips or are
folded before the belly would be inside its body. A solver that avoids the body then has to choose a side by what is
nearest to it at that moment, and may find itself on the wrong one when the person moves on. Here the side is the one on
which the person's arm is:

- Upper arms, and with them the elbows, stay as the person's. The forearm, with the hand as it is held, turns about the
  elbow as far as is needed, in the plane of the forearm and the way out: level, away from the trunk's axis.
- Hands that are too near to each other then both turn, by the same angle, away from each other.
- What is clear already stays as it is, to the last bit.
- A bent waist takes trunk and shoulders along and leaves the pelvis. All is done as the trunk has it:
  level, to the side and to the front are its own.

The turn is the smallest from which on all the way out is clear, found on a grid and between its points, so it grows
from nothing where an arm enters the body. Everything is a pure function of one posture, mirrored for mirrored arms.
Forearms and hands are the description's capsules. What this leaves too near, the solver keeps clear.
"""

from dataclasses import dataclass

import numpy as np

from camera_client.scaling import RobotArms, shoulder_positions
from camera_client.vectors import cross, dot, length, rotate, turn_between, unit
from ik_proto import Array
from ik_proto.robots import ArmDescription, RobotDescription

FOREARM_FROM = 0.5
"""Share of the forearm, from the elbow, that is not looked at: how near the elbow is, the upper arm decides."""
BEHIND = 0.06
"""How far behind the middle of the shoulders the way out begins [m]: what is inside the chest leaves to the front."""
ACROSS = 0.1
"""Over which width the way out of a wrist that crosses the trunk's middle stops pointing to its own side [m]."""
APART = 0.02
"""How far apart wrists are that leave each other half as far as they might [m]."""
MOST_APART = np.radians(45.0)
"""Largest turn of a forearm away from the other hand [rad]."""

ROOM = 0.01
"""What forearms keep beyond the margin of the solver's answers [m]: these arms are straight lines from shoulders that
do not move, and the robot's elbows are up to 14 mm beside them."""

_GRID = np.linspace(0.0, 1.0, 25)
_SIDEWAYS = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Capsules:
    """Capsules that are fixed to the same body.

    Attributes:
        ends: Both ends of their axes, shape (n, 2, 3) [m].
        radii: Shape (n,) [m].
    """

    ends: Array
    radii: Array


class ClearArms:
    """Turns forearms out of a robot's body.

    Attributes:
        trunk: What they are turned out of and the waist moves, at a straight waist, pelvis frame.
        pelvis: And what the waist does not move.
        kept: Clearance that they keep [m].
    """

    def __init__(self, robot: RobotArms, description: RobotDescription) -> None:
        """Read the robot's capsules.

        Args:
            robot: Its arms with a straight waist.
            description: Its description.
        """
        self._robot = robot
        self.kept = description.collision.margin + ROOM
        torso = description.waist[-1] if description.waist else description.base
        self.trunk = _capsules(description, {torso: robot.mount})
        self.pelvis = _capsules(description, {description.base: np.zeros(3)} if description.waist else {})
        self._hands = [_forearm_and_hand(robot, description, arm) for arm in description.arms]

    def __call__(self, limbs: Array, R_pelvis_wrist: Array, robot: RobotArms | None = None) -> tuple[Array, Array]:
        """Turn forearms and hands out of the body.

        Args:
            limbs: Unit directions of upper arm and forearm of both arms, pelvis frame, shape (2, 2, 3).
            R_pelvis_wrist: Orientations of the wrists, x along the forearm, shape (2, 3, 3).
            robot: The robot's arms with its waist as it stands; None for a straight one.

        Returns:
            The same, of arms that are clear of the body as far as turning the forearms does it.
        """
        waist = robot or self._robot
        body = self._body(waist)
        limbs_trunk, R_trunk_wrist = limbs @ waist.R_waist, waist.R_waist.T @ R_pelvis_wrist
        elbows = self._elbows(limbs_trunk)
        turns = np.stack([self._out_of(body, i, elbows[i], limbs_trunk[i, 1], R_trunk_wrist[i]) for i in (0, 1)])
        limbs_trunk, R_trunk_wrist = _turned(limbs_trunk, R_trunk_wrist, turns)
        apart = self._apart(elbows, limbs_trunk[:, 1], R_trunk_wrist)
        # Arms that do not turn must not be rounded by turning the frame forth and back.
        limbs, R_pelvis_wrist = _turned(limbs, R_pelvis_wrist, turns @ waist.R_waist.T)
        return _turned(limbs, R_pelvis_wrist, apart @ waist.R_waist.T)

    def clearance(self, limbs: Array, R_pelvis_wrist: Array, robot: RobotArms | None = None) -> tuple[Array, float]:
        """How far forearms and hands are from the body, shape (2,), and from each other [m]; arguments as above."""
        waist, here = robot or self._robot, np.zeros((1, 3))
        body, limbs, R = self._body(waist), limbs @ waist.R_waist, waist.R_waist.T @ R_pelvis_wrist
        elbows = self._elbows(limbs)
        room = [self._room(body, side, elbows[side], limbs[side, 1], R[side], here)[0] for side in (0, 1)]
        between = self._room_between(elbows, limbs[:, 1], R, np.zeros((1, 2, 3)))[0]
        return np.array(room) + self.kept, float(between) + self.kept

    def _body(self, waist: RobotArms) -> Capsules:
        """Trunk and pelvis as the trunk has them."""
        pelvis = (self.pelvis.ends - waist.p_waist) @ waist.R_waist
        return Capsules(
            np.concatenate([self.trunk.ends, pelvis]), np.concatenate([self.trunk.radii, self.pelvis.radii])
        )

    def _elbows(self, limbs: Array) -> Array:
        return shoulder_positions(limbs[:, 0], self._robot) + self._robot.upper * limbs[:, 0]

    def _out_of(self, body: Capsules, side: int, elbow: Array, f: Array, R: Array) -> Array:
        """The turn of a forearm that takes it out of the body, shape (3,) [rad]."""
        if self._room(body, side, elbow, f, R, np.zeros((1, 3)))[0] >= 0.0:
            return np.zeros(3)
        turn = turn_between(f, self._way_out(side, elbow + self._robot.fore * f))
        room = self._room(body, side, elbow, f, R, _GRID[:, None] * turn)
        return _needed(room) * turn

    def _way_out(self, side: int, wrist: Array) -> Array:
        """Where a wrist leaves the body to, a unit vector, level: forward, back, or to its own side, never across."""
        from_trunk = wrist - self._robot.shoulders.mean(axis=0)
        sideways = _SIDEWAYS[side, 1] * from_trunk[1]
        outward = 0.5 * (sideways + np.hypot(sideways, ACROSS))
        return unit(np.array([from_trunk[0] + BEHIND, _SIDEWAYS[side, 1] * outward, 0.0]))

    def _room(self, body: Capsules, side: int, elbow: Array, f: Array, R: Array, turns: Array) -> Array:
        """Clearance beyond what is kept of a forearm from the body after each of some turns, shape (n,) [m]."""
        hand = self._posed(side, elbow, f, R, turns)
        gaps = segment_distances(hand[:, :, None], body.ends[None, None])
        gaps -= self._hands[side].radii[:, None] + body.radii + self.kept
        return gaps.min(axis=(1, 2))

    def _apart(self, elbows: Array, f: Array, R: Array) -> Array:
        """The turns of both forearms that take the hands away from each other, shape (2, 3) [rad]."""
        if self._room_between(elbows, f, R, np.zeros((1, 2, 3)))[0] >= 0.0:
            return np.zeros((2, 3))
        wrists = elbows + self._robot.fore * f
        between = wrists[0] - wrists[1]
        # Where they meet there is no direction, and nothing that would turn in no time as they pass.
        away = between / (length(between) + APART)
        turns = MOST_APART * cross(f, np.stack([away, -away]))
        return _needed(self._room_between(elbows, f, R, _GRID[:, None, None] * turns)) * turns

    def _room_between(self, elbows: Array, f: Array, R: Array, turns: Array) -> Array:
        """Clearance beyond what is kept of one forearm and hand from the other after turns, shape (n,) [m]."""
        left, right = (self._posed(side, elbows[side], f[side], R[side], turns[:, side]) for side in (0, 1))
        gaps = segment_distances(left[:, :, None], right[:, None])
        gaps -= self._hands[0].radii[:, None] + self._hands[1].radii + self.kept
        return gaps.min(axis=(1, 2))

    def _posed(self, side: int, elbow: Array, f: Array, R: Array, turns: Array) -> Array:
        """Ends of the capsules of a forearm and its hand after turns about the elbow, shape (n, capsules, 2, 3)."""
        points = self._robot.fore * f + self._hands[side].ends @ R.T
        return elbow + rotate(points[None], turns[:, None, None])


def segment_distances(a: Array, b: Array) -> Array:
    """Distances of segments, given by both ends, shape (..., 2, 3), with one another, shape (...).

    The nearest points of two lines, clamped one after the other (C. Ericson, Real-Time Collision Detection, 2005,
    section 5.1.9).
    """
    p, d = a[..., 0, :], a[..., 1, :] - a[..., 0, :]
    q, e = b[..., 0, :], b[..., 1, :] - b[..., 0, :]
    r = p - q
    dd, ee, de = np.maximum(dot(d, d), 1e-12), np.maximum(dot(e, e), 1e-12), dot(d, e)
    dr, er = dot(d, r), dot(e, r)
    s = ((de * er - dr * ee) / np.maximum(dd * ee - de * de, 1e-12)).clip(0.0, 1.0)
    t = ((de * s + er) / ee).clip(0.0, 1.0)
    s = ((de * t - dr) / dd).clip(0.0, 1.0)
    return length(r + s[..., None] * d - t[..., None] * e)


def _forearm_and_hand(robot: RobotArms, description: RobotDescription, arm: ArmDescription) -> Capsules:
    """Capsules of the outer forearm and of the hand, in the frame of the wrist target, x along the forearm."""
    hand = _capsules(description, {arm.wrist.joint: -np.array(arm.wrist.xyz)})
    forearm = _capsules(description, {arm.elbow or arm.wrist.joint: np.zeros(3)})
    axis = np.array([[[(FOREARM_FROM - 1.0) * robot.fore, 0.0, 0.0], [-arm.wrist.xyz[0], 0.0, 0.0]]])
    return Capsules(np.concatenate([axis, hand.ends]), np.concatenate([forearm.radii[:1], hand.radii]))


def _needed(room: Array) -> float:
    """Share of a turn from which on there is room, between the points of the grid."""
    tight = np.flatnonzero(room < 0.0)
    if not len(tight):
        return 0.0
    last = int(tight[-1])
    if last == len(room) - 1:
        return 1.0
    share = room[last] / (room[last] - room[last + 1])
    return float(_GRID[last] + share * (_GRID[last + 1] - _GRID[last]))


def _turned(limbs: Array, R: Array, turns: Array) -> tuple[Array, Array]:
    """Turn forearms and hands by rotation vectors, shape (2, 3); what is not turned stays to the last bit."""
    moved = turns.any(axis=1)
    limbs, R = limbs.copy(), R.copy()
    limbs[moved, 1] = rotate(limbs[moved, 1], turns[moved])
    R[moved] = np.swapaxes(rotate(np.swapaxes(R[moved], 1, 2), turns[moved, None]), 1, 2)
    return limbs, R


def _capsules(description: RobotDescription, bodies: dict[str, Array]) -> Capsules:
    """The capsules of some bodies, moved by the origin of each."""
    found = [capsule for capsule in description.collision.capsules if capsule.body in bodies]
    ends = [bodies[capsule.body] + np.array([capsule.start, capsule.end]) for capsule in found]
    return Capsules(np.array(ends).reshape(-1, 2, 3), np.array([capsule.radius for capsule in found]))
