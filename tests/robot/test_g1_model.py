"""The packaged G1: MuJoCo and Pinocchio read the same robot, its TOML fits it, and its shapes are for looking at."""

import xml.etree.ElementTree as ET
from collections import Counter

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from ik_proto import Array
from ik_proto.robots import RobotDescription, load_description

VISUAL_GROUP, COLLISION_GROUP = 2, 3


@pytest.fixture(scope="module")
def description() -> RobotDescription:
    return load_description("g1")


@pytest.fixture(scope="module")
def model(description: RobotDescription) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(description.model))


@pytest.fixture(scope="module")
def pinocchio(description: RobotDescription) -> pin.Model:
    return pin.buildModelFromMJCF(str(description.model))


@pytest.fixture(scope="module")
def order(model: mujoco.MjModel, pinocchio: pin.Model) -> list[int]:
    """Where Pinocchio keeps MuJoCo's joints: q_pinocchio[order] is q_mujoco."""
    return [pinocchio.joints[pinocchio.getJointId(name)].idx_q for name in joint_names(model)]


def joint_names(model: mujoco.MjModel) -> list[str]:
    return [model.joint(i).name for i in range(model.njnt)]


def body_names(model: mujoco.MjModel) -> list[str]:
    return [model.body(i).name for i in range(1, model.nbody)]


def configurations(model: mujoco.MjModel, count: int) -> Array:
    return np.random.default_rng(0).uniform(model.jnt_range[:, 0], model.jnt_range[:, 1], (count, model.nq))


def reordered(values: Array, order: list[int]) -> Array:
    result = np.empty_like(values)
    result[order] = values
    return result


def test_the_robot_is_there_once(description: RobotDescription, model: mujoco.MjModel, pinocchio: pin.Model) -> None:
    assert len(ET.parse(description.model).findall("worldbody")) == 1
    assert model.nq == model.nv == model.nu == pinocchio.nq == 29


def test_both_know_the_same_joints(model: mujoco.MjModel, pinocchio: pin.Model, order: list[int]) -> None:
    assert sorted(pinocchio.names) == sorted([*joint_names(model), "universe"])
    np.testing.assert_array_equal(pinocchio.lowerPositionLimit[order], model.jnt_range[:, 0])
    np.testing.assert_array_equal(pinocchio.upperPositionLimit[order], model.jnt_range[:, 1])
    np.testing.assert_array_equal(pinocchio.effortLimit[order], model.jnt_actfrcrange[:, 1])
    np.testing.assert_array_equal(pinocchio.armature[order], model.dof_armature)


def test_both_place_every_body_and_wrist_alike(
    model: mujoco.MjModel, pinocchio: pin.Model, order: list[int], description: RobotDescription
) -> None:
    """In the pelvis frame: Pinocchio puts a base without joint at its own origin, not at the height in the file."""
    ours, theirs = mujoco.MjData(model), pinocchio.createData()
    for q in configurations(model, 200):
        ours.qpos[:] = q
        mujoco.mj_kinematics(model, ours)
        pin.framesForwardKinematics(pinocchio, theirs, reordered(q, order))
        frames = {name: (ours.body(name).xpos, ours.body(name).xmat) for name in body_names(model)}
        frames |= {
            arm.wrist.name: (ours.site(arm.wrist.name).xpos, ours.site(arm.wrist.name).xmat) for arm in description.arms
        }
        for name, (position, rotation) in frames.items():
            T_pelvis_frame = theirs.oMf[pinocchio.getFrameId(name)]
            height = ours.body("pelvis").xpos
            np.testing.assert_allclose(T_pelvis_frame.translation, position - height, atol=1e-12, err_msg=name)
            np.testing.assert_allclose(T_pelvis_frame.rotation.ravel(), rotation, atol=1e-12, err_msg=name)


def test_both_weigh_every_body_alike(model: mujoco.MjModel, pinocchio: pin.Model) -> None:
    for name in body_names(model):
        inertia = pinocchio.inertias[pinocchio.frames[pinocchio.getFrameId(name)].parentJoint]
        body = model.body(name)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, body.iquat)
        R = rotation.reshape(3, 3)
        assert inertia.mass == pytest.approx(body.mass[0], rel=1e-12), name
        np.testing.assert_allclose(inertia.lever, body.ipos, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(inertia.inertia, R @ np.diag(body.inertia) @ R.T, atol=1e-10, err_msg=name)


def test_both_find_the_same_centre_of_mass(model: mujoco.MjModel, pinocchio: pin.Model, order: list[int]) -> None:
    """Of what hangs on the pelvis; Pinocchio counts a fixed base to the universe."""
    ours, theirs = mujoco.MjData(model), pinocchio.createData()
    moving = [name for name in body_names(model) if name != "pelvis"]
    for q in configurations(model, 50):
        ours.qpos[:] = q
        mujoco.mj_kinematics(model, ours)
        mujoco.mj_comPos(model, ours)
        mass = np.array([model.body(name).mass[0] for name in moving])
        expected = mass @ np.array([ours.body(name).xipos for name in moving]) / mass.sum()
        com = pin.centerOfMass(pinocchio, theirs, reordered(q, order))
        np.testing.assert_allclose(com, expected - ours.body("pelvis").xpos, atol=1e-12)


def test_both_feel_the_same_gravity_and_coriolis(model: mujoco.MjModel, pinocchio: pin.Model, order: list[int]) -> None:
    ours, theirs = mujoco.MjData(model), pinocchio.createData()
    rng = np.random.default_rng(2)
    for q in configurations(model, 200):
        for v in (np.zeros(model.nv), rng.normal(size=model.nv)):
            ours.qpos[:], ours.qvel[:] = q, v
            mujoco.mj_forward(model, ours)
            torque = pin.rnea(pinocchio, theirs, reordered(q, order), reordered(v, order), np.zeros(model.nv))
            np.testing.assert_allclose(torque[order], ours.qfrc_bias, atol=1e-9)


def test_a_motor_a_joint_in_the_order_of_the_joints(model: mujoco.MjModel) -> None:
    assert [model.actuator(i).name for i in range(model.nu)] == joint_names(model)
    np.testing.assert_array_equal(model.actuator_trnid[:, 0], np.arange(model.njnt))
    np.testing.assert_array_equal(model.actuator_ctrlrange, model.jnt_actfrcrange)
    np.testing.assert_array_equal(model.actuator_gear[:, 0], 1.0)


def test_the_description_covers_every_joint(model: mujoco.MjModel, description: RobotDescription) -> None:
    assert list(description.joints) == joint_names(model)
    for name, joint in description.joints.items():
        lower, upper = model.joint(name).range
        assert lower < joint.home < upper, name
        assert joint.velocity > 0.0, name
        assert joint.kp > joint.kd > 0.0, name


def test_the_arms_are_motors_15_to_28(model: mujoco.MjModel, description: RobotDescription) -> None:
    assert list(description.arm_joints) == joint_names(model)[15:]
    assert list(description.waist) == joint_names(model)[12:15]


def test_the_sites_mark_the_wrist_frames(model: mujoco.MjModel, description: RobotDescription) -> None:
    for arm in description.arms:
        site = model.site(arm.wrist.name)
        assert model.body(site.bodyid[0]).name == arm.wrist.joint.replace("_joint", "_link")
        np.testing.assert_array_equal(site.pos, arm.wrist.xyz)
        np.testing.assert_array_equal(site.quat, [1.0, 0.0, 0.0, 0.0])
        assert arm.wrist.rpy == (0.0, 0.0, 0.0)


def test_the_eyes_look_down_at_the_hands(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    down = np.deg2rad(30.0)
    for name, y in (("left_eye", 0.02), ("right_eye", -0.02)):
        camera = model.camera(name)
        R = data.camera(name).xmat.reshape(3, 3)  # x to the right of the image, y up in it, z back out of it
        np.testing.assert_allclose(-R[:, 2], [np.cos(down), 0.0, -np.sin(down)], atol=1e-7)
        np.testing.assert_allclose(R[:, 0], [0.0, -1.0, 0.0], atol=1e-7)
        np.testing.assert_allclose(data.camera(name).xpos - data.body("pelvis").xpos, [0.0960365, y, 0.504], atol=1e-12)
        assert camera.fovy[0] == 60.0


def test_every_body_can_be_seen(model: mujoco.MjModel) -> None:
    seen = {model.body(model.geom_bodyid[i]).name for i in range(model.ngeom) if model.geom_group[i] == VISUAL_GROUP}
    assert seen == set(body_names(model))


def test_right_is_the_mirror_image_of_left(model: mujoco.MjModel) -> None:
    """Shapes are edited by hand, twice: what changes on one side must change on the other."""

    def shapes(side: str, mirror: float) -> Counter[tuple[object, ...]]:
        return Counter(
            (
                model.body(model.geom_bodyid[i]).name.removeprefix(side),
                model.geom(i).name.removeprefix(side),
                int(model.geom_type[i]),
                int(model.geom_matid[i]),
                *np.round(model.geom_size[i], 9),
                *(np.round(model.geom_pos[i] * [1.0, mirror, 1.0], 9) + 0.0),
            )
            for i in range(model.ngeom)
            if model.body(model.geom_bodyid[i]).name.startswith(side)
        )

    left = shapes("left_", 1.0)
    assert left.total() > 50
    assert left == shapes("right_", -1.0)


def test_links_touch_the_floor_and_not_each_other(description: RobotDescription) -> None:
    spec = mujoco.MjSpec.from_file(str(description.model))
    floor = spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5.0, 5.0, 0.1], contype=1, conaffinity=0
    )
    floor.pos = [0.0, 0.0, 0.8]
    model = spec.compile()
    data = mujoco.MjData(model)
    touched = set()
    for q in configurations(model, 50):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            assert model.geom("floor").id in contact.geom
            assert model.geom_group[contact.geom.max()] == COLLISION_GROUP
            touched.add(model.body(model.geom_bodyid[contact.geom.max()]).name)
    assert touched >= {"left_wrist_yaw_link", "right_wrist_yaw_link", "left_ankle_roll_link", "right_ankle_roll_link"}


def test_the_gains_hold_the_home_posture(model: mujoco.MjModel, description: RobotDescription) -> None:
    """Two seconds of the model's own physics with the described gains: at rest, and no further down than 0.03 rad."""
    home = np.array([joint.home for joint in description.joints.values()])
    kp = np.array([joint.kp for joint in description.joints.values()])
    kd = np.array([joint.kd for joint in description.joints.values()])
    data = mujoco.MjData(model)
    data.qpos[:] = home
    for _ in range(round(2.0 / model.opt.timestep)):
        data.ctrl[:] = kp * (home - data.qpos) - kd * data.qvel
        mujoco.mj_step(model, data)
    assert np.abs(data.qvel).max() < 1e-2
    assert np.abs(data.qpos - home).max() < 0.03
