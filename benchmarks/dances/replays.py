"""Takes recorded motion of people to the robot, and says of each upper arm that was missed why."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.dances.means import ELBOW_LIKE, RATE, Possible, Replay, Retargeting, best_angles, human_motions
from ik_client.joint_limiter import RANGE_INSET, MotionLimits
from ik_proto import Array
from ik_proto.robots import load_description
from ik_service.kernel import load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Solver

_CLIMB_S = 30.0
"""How much of the long clip is replayed [s]."""


_WAISTS = {"forward": (0.0, 0.0, 0.3), "aside": (0.0, 0.25, 0.0), "turned": (0.4, 0.0, 0.0)}
"""How a waist is bent: yaw, roll, pitch [rad]."""
_AT_THE_BODY = ("walk_level1", "kick_level3", "squat_level3", "step_forward_forward_level2", "side_jump_level1")
"""Clips of calm people whose hands are near their bodies."""


def replayed(folder: Path, quick: bool) -> Iterator[dict[str, Any]]:
    """Take people's motion to the robot, clip by clip."""
    robot, retargeting = _robot(None)
    motions = human_motions(folder)
    for motion in motions[::6] if quick else motions:
        limbs = motion.at(RATE, _CLIMB_S)
        possible = retargeting.possible(limbs)
        replay = retargeting.replay(limbs, possible=possible)
        judged = replay.judged()
        off = replay.elbow_off[judged]
        yield {
            "clip": motion.name,
            "seconds": len(replay.wanted) / RATE,
            "beyond": float(np.maximum(robot.lower - replay.commanded, replay.commanded - robot.upper).max()),
            "step": float(np.abs(np.diff(replay.commanded, axis=0)).max() * RATE),
            "clearance": float(replay.clearance.min()),
            "wanted_step": float(np.abs(np.diff(replay.wanted, axis=0)).max()),
            "possible": float(judged.mean()),
            "elbow_p95": float(np.percentile(off, 95)) if len(off) else float("nan"),
            "elbow_like": float((off <= ELBOW_LIKE).mean()) if len(off) else float("nan"),
            "causes": dict(Counter(str(cause) for cause in replay.causes[judged] if cause)),
            "arms": _counts(retargeting, robot, limbs, possible, replay),
        }


def replayed_bent(folder: Path) -> Iterator[dict[str, Any]]:
    """Take calm people's motion to a robot whose waist is bent, which is known to the way out of its body or is not."""
    motions = [motion for motion in human_motions(folder) if motion.name.startswith(_AT_THE_BODY)]
    for name, waist in _WAISTS.items():
        _, retargeting = _robot(np.array(waist))
        row: dict[str, Any] = {"waist": name}
        for knows in (True, False):
            replays = [retargeting.replay(motion.at(RATE), knows_waist=knows) for motion in motions]
            off = np.concatenate([replay.robot_off[replay.judged()] for replay in replays])
            row["known" if knows else "unknown"] = {
                "blocked": float(np.concatenate([replay.blocked for replay in replays]).mean()),
                "robot_like": float((off <= ELBOW_LIKE).mean()),
            }
        yield row


def _robot(waist: Array | None) -> tuple[Robot, Retargeting]:
    description = load_description("g1")
    robot = Robot.load(description)
    solver = Solver(robot, load_kernel(robot), Preset.of(description, "precise"))
    return robot, Retargeting(robot, solver, description, waist)


def _counts(retargeting: Retargeting, robot: Robot, limbs: Array, possible: Possible, replay: Replay) -> dict[str, int]:
    """Upper arms that are judged, and how many of them are like the person's, of what."""
    judged = replay.judged()
    in_time = judged & (_best(retargeting, robot, limbs, possible, judged) <= ELBOW_LIKE)
    answer, command = (off <= ELBOW_LIKE for off in (replay.elbow_off, replay.robot_off))
    onward = retargeting.replay(limbs, possible=possible, start="answer")
    unlimited = retargeting.replay(limbs, possible=possible, start="unlimited")
    like = {
        "judged": judged,
        "answer": judged & answer,
        "robot": judged & command,
        "in_time": in_time,
        "answer_in_time": in_time & answer,
        "robot_in_time": in_time & command,
        "unlimited": judged & (unlimited.elbow_off <= ELBOW_LIKE),
        "onward_answer": judged & (onward.elbow_off <= ELBOW_LIKE),
        "onward_robot": judged & (onward.robot_off <= ELBOW_LIKE),
    }
    return {name: int(arms.sum()) for name, arms in like.items()}


def _best(retargeting: Retargeting, robot: Robot, limbs: Array, possible: Possible, judged: NDArray[np.bool_]) -> Array:
    """Angles of upper arms from the person's, of a robot that knows everything beforehand, shape (n, 2) [degree]."""
    limits, split = MotionLimits(), robot.nq // 2
    most = float(np.min(limits.velocity)), float(np.min(limits.acceleration))
    best = []
    for side in (0, 1):
        joints = slice(side * split, side * split + 2)

        def direction(angles: Array, side: int = side, joints: slice = joints) -> Array:
            q = np.zeros((len(angles), robot.nq))
            q[:, joints] = angles
            return np.array([retargeting.upper_arms(row)[side] for row in q])

        best.append(
            best_angles(
                direction,
                limbs[:, side, 0],
                judged[:, side],
                possible.q[:, joints],
                bounds=(robot.lower[joints] + RANGE_INSET, robot.upper[joints] - RANGE_INSET),
                most=most,
                period=1.0 / RATE,
                within=np.radians(ELBOW_LIKE),
            )
        )
    return np.degrees(np.stack(best, axis=1))
