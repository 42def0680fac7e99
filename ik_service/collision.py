"""The robot's shape for self-collision: capsules, what carries each, and the pairs that are checked.

A capsule is the set of points within a radius of a segment, its axis. Everything here is in the mount frame: the base
frame, carried along by the waist. At a straight waist it is the base frame. In it the arms and the torso do not feel
the waist, and what stays behind on the base moves instead; `CollisionModel.base_ends` says where to.

Pure data: `clearance` makes expressions of it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import numpy as np
import pinocchio as pin

from ik_proto.robots import CapsuleDescription, RobotDescription, RobotError


class Carrier(Enum):
    """What a capsule moves with."""

    LEFT = "left"
    """The left arm's joints, up to the capsule's own."""
    RIGHT = "right"
    """The right arm's joints, up to the capsule's own."""
    TORSO = "torso"
    """The body the arms are mounted on, which the waist carries."""
    BASE = "base"
    """The base body, or a joint that is neither in an arm nor carried by the waist, locked at zero."""


@dataclass(frozen=True)
class Capsule:
    """A capsule fixed to what carries it.

    Attributes:
        name: Its name.
        carrier: What it moves with.
        joint: For an arm, the place in the arm of the joint whose body it is fixed to; else -1.
        start: One end of its axis [m], shape (3,). For an arm, in the frame of that joint's body; for the torso, in the
            mount frame; for the base, in the base frame.
        end: The other end, likewise.
        radius: Its radius [m].
    """

    name: str
    carrier: Carrier
    joint: int
    start: np.ndarray
    end: np.ndarray
    radius: float


@dataclass(frozen=True)
class CollisionModel:
    """The capsules of a robot and the pairs checked against each other.

    Pairs hold places in `capsules`. The first of a pair is moved by an arm: in a pair across the arms the left one, in
    a pair within an arm the one farther from the shoulder. They come in three runs: the left arm against torso, base
    and itself; the right arm likewise; the left arm against the right.

    Attributes:
        capsules: The capsules, in the order of the description.
        pairs: The checked pairs.
        margin: Clearance that an answer keeps [m].
        left: Places in `pairs` of those that the left arm alone can change.
        right: Those that the right arm alone can change.
        across: Those that both arms change.
    """

    capsules: tuple[Capsule, ...]
    pairs: tuple[tuple[int, int], ...]
    margin: float
    left: range
    right: range
    across: range

    @classmethod
    def of(cls, description: RobotDescription, model: pin.Model) -> "CollisionModel":
        """Place the capsules of a description on its model.

        Args:
            description: The robot's description.
            model: Pinocchio's model of it, or a reduced one with at least the joints of arms and waist.

        Returns:
            Capsules and pairs; none of either for a description without [collision].

        Raises:
            RobotError: A capsule's body is neither a joint nor the base, or moves with a part of the waist only.
        """
        capsules = tuple(_place(description, model))
        ignored = {frozenset(entry.pair) for entry in description.collision.ignored}
        runs: dict[str, list[tuple[int, int]]] = {"left": [], "right": [], "across": []}
        for i, j in combinations(range(len(capsules)), 2):
            run, pair = _sort(capsules, i, j)
            if run and frozenset((capsules[i].name, capsules[j].name)) not in ignored:
                runs[run].append(pair)
        left, right = len(runs["left"]), len(runs["left"]) + len(runs["right"])
        pairs = (*runs["left"], *runs["right"], *runs["across"])
        return cls(
            capsules=capsules,
            pairs=pairs,
            margin=description.collision.margin,
            left=range(left),
            right=range(left, right),
            across=range(right, len(pairs)),
        )

    def base_ends(self, T_base_mount: np.ndarray) -> np.ndarray:
        """Ends of the base's capsules as the arms see them.

        Args:
            T_base_mount: Motion of the waist: pose of the mount frame in the base frame, the identity at a straight
                waist, shape (4, 4).

        Returns:
            Starts and ends in the mount frame [m], in the order of `capsules`, shape (count, 2, 3).
        """
        capsules = [capsule for capsule in self.capsules if capsule.carrier is Carrier.BASE]
        ends = np.array([(capsule.start, capsule.end) for capsule in capsules]).reshape(-1, 2, 3)
        # Rows times a rotation apply its inverse.
        return (ends - T_base_mount[:3, 3]) @ T_base_mount[:3, :3]


def _sort(capsules: tuple[Capsule, ...], i: int, j: int) -> tuple[str, tuple[int, int]]:
    """Name the run a pair belongs to, empty for one that no arm can change, and put the pair in order."""
    a, b = capsules[i], capsules[j]
    arms = {Carrier.LEFT, Carrier.RIGHT}
    if (a.carrier, a.joint) == (b.carrier, b.joint) or not {a.carrier, b.carrier} & arms:
        return "", (i, j)
    if a.carrier is b.carrier:
        return a.carrier.value, (i, j) if a.joint > b.joint else (j, i)
    if {a.carrier, b.carrier} == arms:
        return "across", (i, j) if a.carrier is Carrier.LEFT else (j, i)
    return (a.carrier.value, (i, j)) if a.carrier in arms else (b.carrier.value, (j, i))


def _place(description: RobotDescription, model: pin.Model) -> Iterator[Capsule]:
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    T_world_base = data.oMf[model.getFrameId(description.base)]
    for capsule in description.collision.capsules:
        body = _body_frame(description, model, capsule)
        carrier, place, joint = _carrier(description, model, capsule, model.frames[body].parentJoint)
        T_world_carrier = T_world_base if joint is None else data.oMi[joint]
        T_carrier_body = T_world_carrier.inverse() * data.oMf[body]
        yield Capsule(
            name=capsule.name,
            carrier=carrier,
            joint=place,
            start=T_carrier_body.act(np.array(capsule.start)),
            end=T_carrier_body.act(np.array(capsule.end)),
            radius=capsule.radius,
        )


def _body_frame(description: RobotDescription, model: pin.Model, capsule: CapsuleDescription) -> int:
    # A joint that was locked in the model lives on as a frame of its name.
    joints = (pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)
    for index, frame in enumerate(model.frames):
        if frame.name == capsule.body and (frame.type in joints or frame.name == description.base):
            return index
    raise RobotError(
        description.source,
        f"capsule {capsule.name}: body {capsule.body} is neither a joint of {description.model.name} "
        f"nor its base {description.base}",
    )


def _carrier(
    description: RobotDescription, model: pin.Model, capsule: CapsuleDescription, joint: int
) -> tuple[Carrier, int, int | None]:
    """Find what carries a body: the carrier, the place in its arm, and the joint whose frame its ends are in."""
    waist = set()
    while joint > 0:
        name = model.names[joint]
        for carrier, arm in zip((Carrier.LEFT, Carrier.RIGHT), description.arms, strict=True):
            if name in arm.joints:
                return carrier, arm.joints.index(name), joint
        if name in description.waist:
            waist.add(name)
        joint = model.parents[joint]
    # Without a waist nothing moves between base and arms.
    if len(waist) == len(description.waist):
        return Carrier.TORSO, -1, None
    if waist:
        raise RobotError(
            description.source,
            f"capsule {capsule.name}: body {capsule.body} moves with a part of the waist only; "
            f"put it on {description.base} or on {description.waist[-1]}",
        )
    return Carrier.BASE, -1, None
