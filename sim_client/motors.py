"""The motors of the simulated robot: one per hinge, with the position control that runs in the motors of a real one.

    tau = kp (q* - q) - kd dq + tau_ff, cut at the motor's limit as a whole

- MuJoCo evaluates it in every physics step, as ctrl - kp q - kd dq; ctrl = kp q* + tau_ff lasts for a control tick.
- Because kd belongs to the actuator, the integrator `implicitfast` takes the damping of the velocity v' after the step
  of length h, not of v before it. Taken before, it is unstable as soon as h kd > 2 m for some motion of inertia m, and
  with a shoulder raised, pitch and yaw against each other have hardly any.
- Stiffness is taken before the step, which moves q by h v'. Both together are stable, whatever the inertia, where
  h kp < 2 kd: with m, k, d = x^T (M, kp, kd) x for an eigenvector x, an eigenvalue z of the step solves
  (m + h d) z^2 - (2 m + h d - h^2 k) z + m = 0, whose roots are inside the unit circle where h^2 k < 4 m + 2 h d.
- A motor at its limit gives that torque and damps nothing; MuJoCo leaves its kd out of the step. Over a step in which
  the velocity jumps, the torque in effect is that at its beginning less kd (v' - v), which the limit does not cut.
"""

import math

import mujoco

from ik_proto.robots import RobotDescription


def replace_motors(spec: mujoco.MjSpec, description: RobotDescription) -> None:
    """Drive every hinge by position control, whatever actuators the file has; their limits stay.

    Args:
        spec: The robot's model; its actuators are replaced, its sensors removed.
        description: Has the gains.
    """
    efforts = {joint.name: _effort(spec, joint) for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_HINGE}
    for sensor in list(spec.sensors):
        spec.delete(sensor)  # A sensor may refer to an actuator, and nothing here reads sensors.
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for name, effort in efforts.items():
        gains = description.joint(name)
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.biasprm[:3] = 0.0, -gains.kp, -gains.kd
        if math.isfinite(effort):
            motor.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            motor.forcerange = [-effort, effort]


def _effort(spec: mujoco.MjSpec, joint: mujoco.MjsJoint) -> float:
    """Torque limit of a joint [N m]: its own in the file, else its motor's, else none."""
    ranges = [joint.actfrcrange]
    ranges += [actuator.forcerange for actuator in spec.actuators if actuator.target == joint.name]
    for _, upper in ranges:
        if upper > 0.0:
            return float(upper)
    return math.inf
