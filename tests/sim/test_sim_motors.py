"""The simulated motors: position control that is stable in every posture, and cut at the motor's limit as a whole."""

import mujoco
import numpy as np
import pytest
from numpy.typing import ArrayLike
from sim_operator import Operator

from ik_proto import Array
from ik_proto.robots import RobotDescription
from sim_client.arms import ArmKinematics
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.scene import PHYSICS_PERIOD

# Shoulder pitch, roll, yaw, elbow, wrist roll, pitch, yaw of the left arm [rad]; the right one mirrors it.
POSTURES = {
    "hanging": [0.0, 0.2, 0.0, 1.5, 0.0, 0.0, 0.0],
    "T pose": [0.0, 1.57, 0.0, 1.57, 0.0, 0.0, 0.0],
    "raised": [0.0, 2.1, 0.0, 0.8, 0.0, 0.0, 0.0],
    "raised straight": [0.0, 2.1, 0.0, 1.57, 0.0, 0.0, 0.0],
    "forward": [-1.57, 0.1, 0.0, 1.57, 0.0, 0.0, 0.0],
}
MIRROR = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def both(left: ArrayLike) -> Array:
    """Arm joints in wire order of a posture that is the same on both sides [rad]."""
    return np.concatenate([left, MIRROR * np.asarray(left)])


def random_postures(arms: ArmKinematics, count: int) -> Array:
    """Arm joints within their limits, shape (count, 14) [rad]."""
    return np.random.default_rng(5).uniform(arms.lower + 0.2, arms.upper - 0.2, (count, len(arms.lower)))


class Gravity:
    """Torque that carries the arms, by MuJoCo's own bias force."""

    def __init__(self, robot: SimRobot) -> None:
        self._robot, self._data = robot, mujoco.MjData(robot.model)
        joints = [robot.model.joint(name) for name in robot.description.arm_joints]
        self.q_address = np.array([joint.qposadr[0] for joint in joints])
        self.v_address = np.array([joint.dofadr[0] for joint in joints])

    def of(self, q: Array) -> Array:
        """At rest in a posture of the arms, the rest of the body as it is, shape (14,) [N m]."""
        self._data.qpos[:] = self._robot.data.qpos
        self._data.qpos[self.q_address] = q
        self._data.qvel[:] = 0.0
        mujoco.mj_forward(self._robot.model, self._data)
        return self._data.qfrc_bias[self.v_address].copy()


def largest_eigenvalue(robot: SimRobot, q: Array) -> float:
    """Of a control tick, linearised by central differences about arms that rest in a posture, weightless."""
    data, h = robot.data, 1e-6
    robot._home[robot._arms] = q  # Where the onboard controller holds them.
    rest = np.concatenate([robot._home, np.zeros(robot.model.nv)])

    def after(state: Array) -> Array:
        data.qpos[robot._q_address], data.qvel[robot._v_address] = np.split(state, 2)
        robot.advance()
        return np.concatenate([data.qpos[robot._q_address], data.qvel[robot._v_address]])

    columns = [(after(rest + step) - after(rest - step)) / (2.0 * h) for step in h * np.eye(len(rest))]
    return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())


@pytest.fixture
def weightless(g1: RobotDescription) -> SimRobot:
    """Without gravity, so that every posture is one of rest, and without dry friction, which hides what is unstable."""
    robot = SimRobot(g1)
    robot.model.opt.gravity[:] = 0.0
    robot.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    return robot


def test_a_step_is_stable_in_every_posture(weightless: SimRobot, g1_arms: ArmKinematics) -> None:
    postures = [*map(both, POSTURES.values()), *random_postures(g1_arms, 40)]
    assert max(largest_eigenvalue(weightless, q) for q in postures) < 1.0


def test_what_makes_it_stable_is_damping_taken_implicitly(weightless: SimRobot) -> None:
    """Negative control: an integrator that takes the motors' damping before the step."""
    weightless.model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    assert largest_eigenvalue(weightless, both(POSTURES["raised straight"])) > 1.5


def test_the_gains_of_the_g1_are_stable_for_whatever_inertia(g1: RobotDescription) -> None:
    for name, joint in g1.joints.items():
        assert PHYSICS_PERIOD * joint.kp < 2.0 * joint.kd, name


@pytest.mark.parametrize("posture", POSTURES)
def test_arms_come_to_rest_at_their_set_points(g1: RobotDescription, posture: str) -> None:
    """With the torque that carries them, after a push that dry friction alone does not stop."""
    operator = Operator(g1)
    robot, gravity, q = operator.robot, Gravity(operator.robot), both(POSTURES[posture])
    operator.engage()
    while (q_set := robot.read().q_set) is None or np.abs(q_set - q).max() > 1e-6:
        operator.go(1, q, gravity.of(q))
        assert robot.time < 10.0
    robot.data.qvel[gravity.v_address] = 3.0 * np.tile([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 0.0], 2)
    operator.go(150, q, gravity.of(q))
    for _ in range(25):
        operator.go(1, q, gravity.of(q))
        state = robot.read()
        assert np.abs(state.q - q).max() < 2e-3
        assert np.abs(state.dq).max() < 1e-2


def limits_of(robot: SimRobot) -> Array:
    """Largest torque of each joint, by the joints of the model file, shape (nv,) [N m]."""
    assert robot.model.jnt_actfrclimited.all()
    return robot.model.jnt_actfrcrange[:, 1].copy()


def gains_of(robot: SimRobot) -> tuple[Array, Array]:
    """The gains kp and kd, in the order of the model's joints."""
    joints = [robot.description.joint(robot.model.joint(i).name) for i in range(robot.model.njnt)]
    return np.array([joint.kp for joint in joints]), np.array([joint.kd for joint in joints])


def test_the_torque_is_that_of_the_law_and_cut_as_a_whole(g1: RobotDescription) -> None:
    robot = SimRobot(g1)
    data, limit, (kp, kd) = robot.data, limits_of(robot), gains_of(robot)
    rng, cut = np.random.default_rng(6), []
    for _ in range(100):
        robot._q_wanted, robot._tau = rng.uniform(-1.0, 1.0, 29), rng.uniform(-10.0, 10.0, 29)
        data.qpos[:], data.qvel[:] = rng.uniform(-1.0, 1.0, 29), rng.uniform(-10.0, 10.0, 29)
        robot._command_motors()
        mujoco.mj_forward(robot.model, data)
        asked = np.empty(29)
        asked[robot._v_address] = robot._q_wanted
        tau = np.empty(29)
        tau[robot._v_address] = robot._tau
        asked = kp * (asked - data.qpos) - kd * data.qvel + tau
        np.testing.assert_allclose(data.qfrc_actuator, np.clip(asked, -limit, limit), atol=1e-9)
        cut.append(np.abs(asked) > limit)
    assert 0.1 < np.mean(cut) < 0.9


def test_damping_counts_against_the_limit(toy: RobotDescription) -> None:
    """A motor whose spring asks for more than it can give, but whose damping takes that back, is not cut."""
    robot = SimRobot(toy)
    robot._q_wanted[robot.model.actuator("left_a").id] = 1.0
    robot._command_motors()
    for speed, torque in ((0.0, 7.0), (15.0, 60.0 * 0.6 - 2.0 * 15.0), (30.0, -7.0)):
        robot.data.joint("left_a").qvel[0] = speed
        mujoco.mj_forward(robot.model, robot.data)
        assert robot.data.joint("left_a").qfrc_actuator[0] == pytest.approx(torque), speed


@pytest.mark.parametrize("posture", ["hanging", "T pose"])
def test_it_moves_as_with_a_physics_step_fifty_times_finer(g1: RobotDescription, posture: str) -> None:
    """Against the law written out here, of plain torques; the set-point jumps, and some motors are at their limits."""
    robot, fine = SimRobot(g1), SimRobot(g1)
    fine.model.opt.timestep = PHYSICS_PERIOD / 50
    fine.model.actuator_gainprm[:] = fine.model.actuator_biasprm[:] = 0.0
    limit, (kp, kd) = limits_of(fine), gains_of(fine)
    q_address, q = Gravity(robot).q_address, both(POSTURES[posture])
    robot._home[robot._arms] = both(np.subtract(POSTURES[posture], 0.4))
    wanted = fine.data.qpos.copy()
    wanted[q_address] = robot._home[robot._arms]
    for data in (robot.data, fine.data):
        data.qpos[q_address] = q
    cut = apart = speed = 0.0
    for _ in range(25):
        robot.advance()
        for _ in range(round(CONTROL_PERIOD / fine.model.opt.timestep)):
            tau = kp * (wanted - fine.data.qpos) - kd * fine.data.qvel
            cut = max(cut, float((np.abs(tau) - limit).max()))
            fine.data.qfrc_applied[:] = np.clip(tau, -limit, limit)
            mujoco.mj_step(fine.model, fine.data)
        speed = max(speed, float(np.abs(fine.data.qvel).max()))
        apart = max(apart, float(np.abs(robot.data.qpos - fine.data.qpos).max()))
    assert cut > 1.0
    assert apart < PHYSICS_PERIOD * speed  # No more than a physics step late.
