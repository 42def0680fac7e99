"""A simulated robot behind the robot port: the far end of the teleop loop.

- `send` takes a command for the arm joints; `advance` runs the physics of one control tick.
- A `RobotGuard` has the last word, as on a real robot: whom to follow, how fast, and how much the set-point counts.
- An onboard controller holds every joint at home. Of the arms, q* is the guard's set-point times its weight and the
  onboard controller's times the rest, and so is the feed-forward torque, which the onboard controller has none of.
- The motors apply tau = kp (q* - q) - kd dq + feed-forward in every physics step, with the gains of the description,
  and cut it at their limits; `motors` says how that stays stable.
- The base is held in space.
- Joints are found by name; their order in the model file does not matter.
"""

import time
from collections.abc import Callable

import mujoco
import numpy as np

from ik_client import Command, RobotState, WristMotion
from ik_client.robot_end import EndState, Reception, RobotGuard
from ik_client.robot_end.guard import RAMP
from ik_proto import Array
from ik_proto.robots import RobotDescription
from sim_client.model import WRIST_SITES, body_pose, invert, wrist_poses
from sim_client.scene import PHYSICS_PERIOD, TARGET_BODIES, build_scene

STEPS_PER_TICK = 4
CONTROL_PERIOD = STEPS_PER_TICK * PHYSICS_PERIOD
"""Time between two commands [s]."""

MOTION_LASTS = 0.3
"""How long what a command says of the wrists' motion is of interest [s]."""


class SimRobot:
    """A robot in MuJoCo, standing at home.

    Attributes:
        description: What it was built from.
        model: The MuJoCo model.
        data: Its state.
        ticks: Control ticks simulated.
        ticks_without_command: Those of them for which no new command had come.
        guard: Its own end of the teleop loop.
    """

    def __init__(
        self, description: RobotDescription, *, clock: Callable[[], float] = time.monotonic, ramp: float = RAMP
    ) -> None:
        """Build the model and put every joint at home; the arms are the onboard controller's.

        Args:
            description: The robot.
            clock: Monotonic time, by which commands are late [s].
            ramp: How long the weight takes from 0 to 1, and back, in simulated time [s].

        Raises:
            RobotError: The description does not fit its model file.
            ImportError: ruckig is not installed.
        """
        self.description = description
        self.model = build_scene(description)
        self.data = mujoco.MjData(self.model)
        self.ticks = 0
        self.ticks_without_command = 0
        self._clock = clock
        joints = [self.model.joint(self.model.actuator(i).name) for i in range(self.model.nu)]
        described = [description.joint(joint.name) for joint in joints]
        self._q_address = np.array([joint.qposadr[0] for joint in joints])
        self._v_address = np.array([joint.dofadr[0] for joint in joints])
        self._kp = np.array([joint.kp for joint in described])
        self._home = np.array([joint.home for joint in described])
        self._q_wanted = self._home.copy()
        self._tau = np.zeros(len(joints))
        self._arms = np.array([self.model.actuator(name).id for name in description.arm_joints])
        self._waist = np.array([self.model.actuator(name).id for name in description.waist], dtype=int)
        self._base = self.model.body(description.base).id
        left, right = WRIST_SITES
        self._sites = (self.model.site(left).id, self.model.site(right).id)
        self._mocap = tuple(int(self.model.body(name).mocapid[0]) for name in TARGET_BODIES)
        self._commanded = False
        self._motion: tuple[WristMotion | None, float] = (None, -np.inf)
        lower, upper = _ranges([joints[i] for i in self._arms])
        self.guard = RobotGuard(len(self._arms), CONTROL_PERIOD, lower=lower, upper=upper, ramp=ramp)
        self.data.qpos[self._q_address] = self._q_wanted
        self._command_motors()
        mujoco.mj_forward(self.model, self.data)
        self.show_targets(*self.wrists())

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.data.time

    def read(self) -> RobotState:
        """Measure the joints of the arms and of the waist, which gives way a little under their weight."""
        return self.read_for(busy=False)

    def read_for(self, *, busy: bool) -> RobotState:
        """The same, for one of several sources.

        Args:
            busy: Whether another source than the one that asks holds the robot.
        """
        q, dq = self.data.qpos[self._q_address], self.data.qvel[self._v_address]
        waist = q[self._waist] if len(self._waist) else None
        return self.guard.report(q[self._arms], dq[self._arms], self._clock(), waist, busy)

    def send(self, command: Command) -> None:
        """Offer a command to the guard, now."""
        self.offer(command, self._clock())

    def offer(self, command: Command, arrived: float) -> Reception:
        """Offer a command to the guard.

        Args:
            command: The command.
            arrived: When it came, by the robot's clock [s].

        Returns:
            What became of it.
        """
        reception = self.guard.offer(command, arrived)
        if reception is Reception.ACCEPTED:
            self._commanded = True
            self._motion = command.motion, arrived
        return reception

    @property
    def motion(self) -> WristMotion | None:
        """What the latest command says of the wrists' motion; None where it says nothing, or is old."""
        motion, arrived = self._motion
        return motion if 0.0 <= self._clock() - arrived <= MOTION_LASTS else None

    def release(self) -> None:
        """Give the arms back for good, because the program ends; `advance` until the guard's weight is 0."""
        self.guard.release()

    @property
    def released(self) -> bool:
        """Whether the arms are the onboard controller's."""
        return self.guard.state is EndState.RELEASED

    def advance(self) -> None:
        """Simulate one control tick."""
        self.ticks += 1
        self.ticks_without_command += not self._commanded
        self._commanded = False
        self._take_setpoint()
        self._command_motors()
        mujoco.mj_step(self.model, self.data, STEPS_PER_TICK)
        mujoco.mj_kinematics(self.model, self.data)  # Poses of the state that was reached, not of the one before it.

    def _take_setpoint(self) -> None:
        setpoint = self.guard.step(self._clock(), self.data.qpos[self._q_address[self._arms]])
        onboard = 1.0 - setpoint.weight
        self._q_wanted[self._arms] = setpoint.weight * setpoint.q + onboard * self._home[self._arms]
        self._tau[self._arms] = setpoint.weight * setpoint.tau

    def _command_motors(self) -> None:
        """Tell the motors where to be, and with what torque beside that of their own position control."""
        self.data.ctrl[:] = self._kp * self._q_wanted + self._tau

    def wrists(self) -> tuple[Array, Array]:
        """Wrist poses `T_pelvis_wrist`, left and right, shape (4, 4) each [m]."""
        return wrist_poses(self.data, self._base, self._sites)

    def show_targets(self, left: Array, right: Array) -> None:
        """Put the visible targets somewhere.

        Args:
            left: `T_pelvis_target`, shape (4, 4) [m].
            right: The same for the right arm.
        """
        T_world_pelvis = body_pose(self.data, self._base)
        for mocap, T_pelvis_target in zip(self._mocap, (left, right), strict=True):
            T = T_world_pelvis @ T_pelvis_target
            self.data.mocap_pos[mocap] = T[:3, 3]
            mujoco.mju_mat2Quat(self.data.mocap_quat[mocap], T[:3, :3].ravel())

    def shown_targets(self) -> tuple[Array, Array]:
        """Where the visible targets are, left and right, `T_pelvis_target`, shape (4, 4) each [m]."""
        T_pelvis_world = invert(body_pose(self.data, self._base))
        left, right = (T_pelvis_world @ self._mocap_pose(mocap) for mocap in self._mocap)
        return left, right

    def _mocap_pose(self, mocap: int) -> Array:
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, self.data.mocap_quat[mocap])
        T = np.eye(4)
        T[:3, :3] = rotation.reshape(3, 3)
        T[:3, 3] = self.data.mocap_pos[mocap]
        return T


def _ranges(joints: list) -> tuple[Array, Array]:
    """Position limits of some joints, lower and upper [rad]; infinite where a joint has none."""
    lower, upper = np.array([joint.range if joint.limited[0] else (-np.inf, np.inf) for joint in joints]).T
    return lower, upper
