"""How the wrists shall move and do: what a loop asked for beside what the physics shows.

What a service promised is not shown as if it were so: the velocity drawn as achieved is measured in the simulation.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from ik_client import WristMotion
from ik_proto import Array
from sim_client.model import WRIST_SITES, body_pose
from sim_client.robot import SimRobot


@dataclass(frozen=True, slots=True, eq=False)
class MotionView:
    """What there is to see of a motion. Pairs are left, right.

    Attributes:
        motion: What the loop asked for and was told.
        measured: Velocity of each wrist in the simulation, in the pelvis frame, linear [m/s] and angular [rad/s], shape
            (2, 6).
        joints: Names of the joints of each arm.
        places: Where each joint is between its limits: -1 at the lower, 1 at the upper, 0 in the middle and where there
            are none; a list for each arm.
    """

    motion: WristMotion
    measured: Array
    joints: tuple[tuple[str, ...], tuple[str, ...]]
    places: tuple[Array, Array]


def look(robot: SimRobot) -> MotionView | None:
    """Look at a robot.

    Args:
        robot: After a control tick.

    Returns:
        What there is to see; None where no loop says how the wrists shall move.
    """
    motion = robot.motion
    if motion is None:
        return None
    left, right = (arm.joints for arm in robot.description.arms)
    return MotionView(motion, measured_twists(robot), (left, right), (_places(robot, left), _places(robot, right)))


def measured_twists(robot: SimRobot) -> Array:
    """Velocities of the wrists as they are simulated, linear [m/s] and angular [rad/s], pelvis frame, shape (2, 6)."""
    model, data = robot.model, robot.data
    mujoco.mj_comPos(model, data)  # The kinematics are those of the state that was reached; Jacobians need this too.
    R = body_pose(data, model.body(robot.description.base).id)[:3, :3]
    twists = []
    for name in WRIST_SITES:
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, linear, angular, model.site(name).id)
        twists.append(np.concatenate((R.T @ linear @ data.qvel, R.T @ angular @ data.qvel)))
    return np.array(twists)


def _places(robot: SimRobot, names: tuple[str, ...]) -> Array:
    """Where joints are between their limits, from -1 to 1."""
    places = []
    for name in names:
        joint = robot.model.joint(name)
        lower, upper = joint.range
        q = robot.data.qpos[joint.qposadr[0]]
        places.append((2.0 * q - lower - upper) / (upper - lower) if joint.limited[0] else 0.0)
    return np.clip(places, -1.0, 1.0)
