"""Rate control of both arms: twists of the wrists to joint velocities, a pure function of the request.

Two laws (`resolved_rate`): "adaptive" moves the hand as it is told, orientation included, and is damped only near
singular postures; "fixed" is the damped pseudoinverse with a constant factor and the orientation left free. Around
both stand the same bounds: joint speed and acceleration, joint limits, a box for each wrist, and the body. A bound
slows the whole arm down, so the hand keeps its direction; what leads away from the bound is free.
"""

from dataclasses import dataclass

import numpy as np

from ik_proto import Frame, Law, LimitedBy
from ik_proto.limits import (
    DEFAULT_ACCELERATION,
    DEFAULT_DAMPING,
    DEFAULT_PERIOD,
    DEFAULT_POSTURE_GAIN,
    DEFAULT_SPEED,
)
from ik_service.problem import COLLISION, Collision, bind
from ik_service.robot import Robot
from ik_service.velocity_kernel import VelocityKernel
from ik_service.velocity_law import ARM_REPORT, FREE, REPORT, VelocityLayout, row_names

WHOLE = 0.999
"""A motion of which no bound took more than the rest is not limited."""


@dataclass(slots=True)
class Velocity:
    """Answer to one request. Pairs are left, right.

    Attributes:
        dq: Joint velocities [rad/s], shape (nq,).
        twists: What they make of the wrists in the middle of the period, in the request's frame, linear [m/s] and
            angular [rad/s], shape (2, 6).
        manipulability: sqrt(det(J J^T)) of the whole twist, or of its linear part where that alone counts [m^3], shape
            (2,).
        damping: Damping that was used, zero where none was needed, shape (2,).
        limited_by: What slowed each arm the most; empty for nothing.
        limiting_joint: The joint at its limit or its largest speed, where that is what slowed the arm.
        clearance: Smallest distance of any checked pair of capsules at q [m]; infinite with nothing checked.
        nearest: Names of the capsules of that pair; None with nothing checked.
    """

    dq: np.ndarray
    twists: np.ndarray
    manipulability: np.ndarray
    damping: np.ndarray
    limited_by: tuple[LimitedBy, LimitedBy]
    limiting_joint: tuple[str | None, str | None]
    clearance: float
    nearest: tuple[str, str] | None


class RateController:
    """Turns twists into joint velocities, one request at a time.

    Cheap to make from a shared kernel; owns its buffers, so each thread needs its own.
    """

    def __init__(self, robot: Robot, kernel: VelocityKernel) -> None:
        """Bind the kernel to buffers.

        Args:
            robot: The robot.
            kernel: A kernel loaded for this robot.
        """
        self.kernel = kernel
        self._robot = robot
        layout = VelocityLayout.of(robot)
        request, self._request = _vector(layout.request)
        options, self._options = _vector(layout.options)
        answer, self._answer = _vector(layout.answer)
        self._report = np.zeros(len(REPORT))
        self._call, self._kept_alive = bind(kernel.law, (request, options), (answer, self._report))
        self._middle = 0.5 * (robot.lower + robot.upper)
        self._rows = [row_names(robot, arm) for arm in (0, 1)]
        self._halves = (slice(0, robot.arms[0].n), slice(robot.arms[0].n, robot.nq))
        names = [capsule.name for capsule in robot.collision.capsules]
        self._pairs = [(names[i], names[j]) for i, j in robot.collision.pairs]

    def solve(
        self,
        left_twist: np.ndarray,
        right_twist: np.ndarray,
        q: np.ndarray,
        dq: np.ndarray | None = None,
        *,
        frame: Frame = "pelvis",
        law: Law = "adaptive",
        hold: tuple[bool, bool] = (True, True),
        damping: float = DEFAULT_DAMPING,
        max_speed: float = DEFAULT_SPEED,
        max_acceleration: float = DEFAULT_ACCELERATION,
        period: float = DEFAULT_PERIOD,
        posture: np.ndarray | None = None,
        posture_gain: float = DEFAULT_POSTURE_GAIN,
        left_bounds: np.ndarray | None = None,
        right_bounds: np.ndarray | None = None,
        collision: Collision = "avoid",
        waist: np.ndarray | None = None,
    ) -> Velocity:
        """Find the joint velocities of both arms for the period to come.

        Args:
            left_twist: Wanted linear velocity of the left wrist [m/s] and its angular velocity [rad/s], shape (6,); of
                shape (3,) the linear part alone, with no rotation wanted.
            right_twist: The same of the right wrist.
            q: Joint positions [rad], shape (nq,).
            dq: Joint velocities that the arms have, as last commanded [rad/s], shape (nq,); None leaves the
                acceleration unbounded, and takes the Jacobians at q instead of half a period later.
            frame: "pelvis", or "hand" for twists along the axes of each hand.
            law: "adaptive" or "fixed".
            hold: Whether the orientation of each hand is controlled; else it is left free. The fixed law leaves it
                free.
            damping: Of the fixed law, and the largest of the adaptive one.
            max_speed: Largest speed of a joint [rad/s].
            max_acceleration: Largest change of a joint's speed [rad/s^2].
            period: Time until the next request [s]: that times `max_acceleration` is how far a speed may change.
            posture: Joint positions that the arms lean towards where the hands leave them the choice [rad], shape
                (nq,); None for the middle between the limits.
            posture_gain: How much of the way there is made in a second [1/s]; 0 for none.
            left_bounds: Smallest and largest coordinates of the left wrist in the base frame [m], shape (2, 3).
            right_bounds: The same of the right wrist.
            collision: "off" checks nothing, "report" measures the clearance, "avoid" keeps it.
            waist: Waist joint positions [rad]; None for a straight waist.

        Returns:
            The answer; its arrays are the caller's.
        """
        request, options = self._request, self._options
        request["q"][:] = q
        request["dq"][:] = 0.0 if dq is None else dq
        for i, twist in enumerate((left_twist, right_twist)):
            part = request["twists"][6 * i : 6 * i + 6]
            part[:3], part[3:] = twist[:3], twist[3:] if len(twist) == 6 else 0.0
        fixed = law == "fixed"
        options["waist"][:] = 0.0 if waist is None else waist
        options["hand_frame"][:] = frame == "hand"
        options["fixed"][:] = fixed
        options["held"][:] = (False, False) if fixed else hold
        options["damping"][:], options["max_speed"][:] = damping, max_speed
        options["max_acceleration"][:] = FREE if dq is None else max_acceleration
        options["period"][:] = period
        options["posture"][:] = self._middle if posture is None else posture
        options["posture_gain"][:] = posture_gain
        options["collision"][:] = COLLISION[collision]
        for i, bounds in enumerate((left_bounds, right_bounds)):
            box = options["bounds"][6 * i : 6 * i + 6]
            box[:3], box[3:] = (-FREE, FREE) if bounds is None else bounds
        self._call()
        return self._velocity()

    def _velocity(self) -> Velocity:
        """Interpret what the kernel says."""
        dq = self._answer["dq"].copy()
        report = self._report.tolist()
        count = len(ARM_REPORT)
        arms = [dict(zip(ARM_REPORT, report[i * count : (i + 1) * count], strict=True)) for i in (0, 1)]
        left, right = (self._limit(i, arm, dq) for i, arm in enumerate(arms))
        clearance, place, _ = report[2 * count :]
        return Velocity(
            dq=dq,
            twists=self._answer["twists"].reshape(2, 6).copy(),
            manipulability=np.array([arm["manipulability"] for arm in arms]),
            damping=np.array([arm["damping"] for arm in arms]),
            limited_by=(left[0], right[0]),
            limiting_joint=(left[1], right[1]),
            clearance=clearance,
            nearest=self._pairs[int(place)] if place >= 0.0 else None,
        )

    def _limit(self, i: int, arm: dict[str, float], dq: np.ndarray) -> tuple[LimitedBy, str | None]:
        """What took the most of an arm's motion, and the joint that it was."""
        speed = arm["slowed"] * arm["hurried"]
        least = min(speed, arm["share"], arm["damped"], arm["apart"])
        if least >= WHOLE:
            return ("acceleration" if min(arm["ramp"], arm["held_back"]) < WHOLE else ""), None
        if least == arm["apart"]:
            return "collision", None
        if least == arm["damped"]:
            return "singularity", None
        if least == arm["share"]:
            kind, joint = self._rows[i][int(arm["place"])]
            return kind, joint
        half = self._halves[i]
        return "speed", self._robot.joint_names[half.start + int(np.argmax(np.abs(dq[half])))]


def _vector(parts: dict[str, slice]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A vector of zeros, and views of its parts."""
    vector = np.zeros(max(part.stop for part in parts.values()))
    return vector, {key: vector[part] for key, part in parts.items()}
