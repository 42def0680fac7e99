"""Scaling: a G1 is scaled to itself, by Pinocchio; and directions and the share of the reach are kept."""

import numpy as np
import pinocchio as pin
import pytest

from camera_client.robot_arms import robot_geometry
from camera_client.scaling import G1_ARMS, elbow_hints, shoulder_positions, wrist_positions
from camera_client.vectors import unit
from ik_proto.robots import load_description

SIDES = ("left", "right")


def g1_arms(q_of: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Shoulder roll joint, elbow and end-effector of both arms, shape (2, 3, 3), and the first joints, pelvis frame."""
    model = pin.buildModelFromMJCF(str(load_description("g1").model))
    data, q = model.createData(), pin.neutral(model)
    for name, angle in q_of.items():
        q[model.joints[model.getJointId(name)].idx_q] = angle
    pin.framesForwardKinematics(model, data, q)
    pelvis = data.oMf[model.getFrameId("pelvis")]
    arms, first = [], []
    for side in SIDES:
        M = {
            joint: pelvis.inverse() * data.oMi[model.getJointId(f"{side}_{joint}_joint")]
            for joint in ("shoulder_pitch", "shoulder_roll", "elbow", "wrist_yaw")
        }
        wrist = M["wrist_yaw"].translation + M["wrist_yaw"].rotation @ (0.05, 0.0, 0.0)
        arms.append([M["shoulder_roll"].translation, M["elbow"].translation, wrist])
        first.append(M["shoulder_pitch"].translation)
    return np.array(arms), np.array(first)


def postures(count: int) -> list[dict[str, float]]:
    rng = np.random.default_rng(0)
    return [
        {
            f"{side}_{joint}_joint": float(rng.uniform(-1.0, 1.0))
            for side in SIDES
            for joint in ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")
        }
        for _ in range(count)
    ]


@pytest.mark.parametrize("posture", postures(5))
def test_a_g1_as_operator_is_mirrored(posture):
    """To 4 mm: the shoulder's centre goes round the axis of the first joint at 14 mm, and is followed there."""
    arms, first = g1_arms(posture)
    limbs = unit(np.diff(arms, axis=1))
    assert np.linalg.norm(wrist_positions(limbs, G1_ARMS) - arms[:, 2], axis=1).max() < 0.004
    assert np.linalg.norm(shoulder_positions(limbs[:, 0], G1_ARMS) - arms[:, 0], axis=1).max() < 0.004
    hints = elbow_hints(limbs, np.array([0.25, 1.0]), G1_ARMS)
    assert np.allclose(hints[:, :3], unit(arms[:, 1] - first), atol=0.06)
    assert (hints[:, 3] == (0.25, 1.0)).all()


@pytest.mark.parametrize("waist", [(0.5, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.5), (0.3, -0.2, 0.4)])
@pytest.mark.parametrize("posture", postures(5))
def test_a_g1_with_a_bent_waist_is_mirrored_as_well(posture, waist):
    description = load_description("g1")
    arms, first = g1_arms({**posture, **dict(zip(description.waist, waist, strict=True))})
    robot = robot_geometry(description).bent(np.array(waist))
    limbs = unit(np.diff(arms, axis=1))
    assert np.linalg.norm(wrist_positions(limbs, robot) - arms[:, 2], axis=1).max() < 0.004
    assert np.linalg.norm(shoulder_positions(limbs[:, 0], robot) - arms[:, 0], axis=1).max() < 0.004
    assert np.allclose(elbow_hints(limbs, np.ones(2), robot)[:, :3], unit(arms[:, 1] - first), atol=0.06)


def test_a_stretched_arm_is_a_stretched_arm_in_every_direction():
    rng = np.random.default_rng(1)
    for direction in unit(rng.standard_normal((20, 3))):
        p = wrist_positions(np.tile(direction, (2, 2, 1)), G1_ARMS)
        shoulders = shoulder_positions(np.tile(direction, (2, 1)), G1_ARMS)
        assert np.allclose(p - shoulders, (G1_ARMS.upper + G1_ARMS.fore) * direction)


def test_the_shoulders_never_jump():
    """A small turn of the upper arm moves the shoulder a little, wherever the arm points, also along the axis."""
    rng = np.random.default_rng(2)
    u = unit(np.concatenate([rng.standard_normal((3000, 3)), G1_ARMS.axes[0] + 0.02 * rng.standard_normal((500, 3))]))
    near = unit(u + 1e-4 * rng.standard_normal(u.shape))
    for a, b in zip(u, near, strict=True):
        moved = shoulder_positions(np.tile(b, (2, 1)), G1_ARMS) - shoulder_positions(np.tile(a, (2, 1)), G1_ARMS)
        assert np.abs(moved).max() < 0.1 * np.linalg.norm(b - a) + 1e-12
