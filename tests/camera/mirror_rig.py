"""What it takes to see a robot mirror a person: who watches the robot, and where its limbs point."""

import contextlib
import threading
import time
from dataclasses import dataclass

import mujoco
import numpy as np
from choreography import Choreography
from skinned_person import Array

from ik_client.robot_end import RobotLink, RobotSilent
from ik_proto.robots import RobotDescription, load_description

REACH = ((1.0, 0.15, -0.4), (1.0, 0.1, -0.25))
"""Forward and a little down, as to a table. Of an arm that points straight at the camera a pose model sees little:
there the upper arm is up to 18 degrees off."""
RELAXED = ((0.0, 0.35, -0.95), (0.15, 0.3, -0.95))
"""Hanging, with the hand clear of the thigh: a robot's hand is larger, and stops before it."""
QUICK = Choreography(
    keys=(
        (0.0, RELAXED, RELAXED),
        (5.4, RELAXED, RELAXED),
        (6.2, "T", "T"),
        (7.8, "T", "T"),
        (8.6, REACH, REACH),
        (10.2, REACH, REACH),
        (11.0, RELAXED, "raised"),
        (12.6, RELAXED, "raised"),
        (12.8, RELAXED, "raised"),
    ),
)
"""A T pose, both arms forward, the right arm up, after a while in which the arms come to the operator's."""
STILL = {"T": (7.1, 7.8), "reach": (9.5, 10.2), "raised": (11.9, 12.6)}
"""When the arms have been still for a while and still are [s]."""
PRESS = 0.5
"""When the switch is pressed [s]."""


@dataclass(frozen=True)
class Measured:
    """What the robot measured at a time [s]."""

    time: float
    q: Array
    waist: Array | None
    following: bool
    q_set: Array | None = None


class Watcher:
    """Watches a robot from a thread of its own."""

    def __init__(self, url: str) -> None:
        self.seen: list[Measured] = []
        self._url = url
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> "Watcher":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def between(self, begin: float, end: float) -> list[Measured]:
        """What was measured in a time [s]."""
        return [one for one in self.seen if begin <= one.time <= end]

    def _watch(self) -> None:
        with RobotLink(self._url) as robot:
            while not self._end.wait(0.02):
                with contextlib.suppress(RobotSilent):
                    state = robot.read()
                    self.seen.append(
                        Measured(
                            time.monotonic(),
                            np.array(state.q),
                            state.waist,
                            state.following and state.ready,
                            state.q_set,
                        )
                    )


class Limbs:
    """Where a robot's limbs point, by MuJoCo."""

    def __init__(self, description: RobotDescription | None = None) -> None:
        self._description = description or load_description("g1")
        self._model = mujoco.MjModel.from_xml_path(str(self._description.model))
        self._data = mujoco.MjData(self._model)

    def qpos(self, measured: Measured) -> Array:
        """Positions of all joints, the legs' at zero, shape (nq,) [rad]."""
        qpos = np.zeros(self._model.nq)
        for name, angle in zip(self._description.arm_joints, measured.q, strict=True):
            qpos[self._model.joint(name).qposadr[0]] = angle
        for name, angle in zip(self._description.waist, [] if measured.waist is None else measured.waist, strict=False):
            qpos[self._model.joint(name).qposadr[0]] = angle
        return qpos

    def directions(self, measured: Measured) -> Array:
        """Unit directions of upper arm and forearm, left and right, shape (2, 2, 3), pelvis frame."""
        self._data.qpos[:] = self.qpos(measured)
        mujoco.mj_kinematics(self._model, self._data)
        out = []
        for arm in self._description.arms:
            shoulder, elbow = (self._data.joint(name).xanchor for name in (arm.joints[1], arm.elbow))
            body = self._data.body(self._model.body(self._model.joint(arm.wrist.joint).bodyid[0]).id)
            wrist = body.xpos + body.xmat.reshape(3, 3) @ np.array(arm.wrist.xyz)
            out.append([elbow - shoulder, wrist - elbow])
        pelvis = self._data.body(self._description.base).xmat.reshape(3, 3)
        directions = np.array(out) @ pelvis
        return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def angles(robot: Array, person: Array) -> Array:
    """Angles between directions, shape (...) [deg]."""
    person = person / np.linalg.norm(person, axis=-1, keepdims=True)
    return np.degrees(np.arccos(np.clip((robot * person).sum(axis=-1), -1.0, 1.0)))


def person_directions(dance: Choreography, t: float) -> Array:
    """Unit directions of a dancer's upper arms and forearms, shape (2, 2, 3), pelvis frame."""
    u, f, _, _ = dance.at(t)
    return np.stack([u, f], axis=1)
