"""The G1 against a model this project did not write.

The vendor's MJCF prints six significant digits, and ours follows the URDF's full ones. So single numbers must be equal
when ours are printed the same way. An inertia there is a rounded quaternion and three rounded moments; what is
left of it is good to some 4e-6 of its norm.
"""

import os
from pathlib import Path

import mujoco
import numpy as np
import pytest
import vendor

from ik_proto import Array
from ik_proto.robots import RobotDescription, load_description

pytestmark = pytest.mark.timeout(400)

FK_TOLERANCE = 1e-5
"""Largest distance between the wrists of the two models [m]."""

INERTIA_TOLERANCE = 1e-5
"""Largest difference of two inertia tensors, as a share of their norm."""


@pytest.fixture(scope="module")
def description() -> RobotDescription:
    return load_description("g1")


@pytest.fixture(scope="module")
def ours(description: RobotDescription) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(description.model))


@pytest.fixture(scope="module")
def vendor_file() -> Path:
    try:
        return vendor.vendor_file()
    except vendor.Unavailable as error:
        if "CI" in os.environ:
            pytest.fail(str(error))
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def theirs(vendor_file: Path) -> mujoco.MjModel:
    return vendor.load_without_meshes(vendor_file).compile()


def printed(values: Array) -> list[str]:
    """Numbers as the vendor prints them."""
    return [f"{value:.6g}" for value in np.ravel(values)]


def bodies(model: mujoco.MjModel) -> dict[str, str]:
    """Parent of every body."""
    return {model.body(i).name: model.body(model.body_parentid[i]).name for i in range(1, model.nbody)}


def inertia(model: mujoco.MjModel, body: str) -> Array:
    """Inertia about the centre of mass in the axes of the body, shape (3, 3) [kg m^2]."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.body(body).iquat)
    R = rotation.reshape(3, 3)
    return R @ np.diag(model.body(body).inertia) @ R.T


def furthest_wrists(
    ours: mujoco.MjModel, theirs: mujoco.MjModel, description: RobotDescription, count: int
) -> tuple[float, float]:
    """Largest distance [m] and angle [rad] between the wrists of two models over random configurations."""
    rng = np.random.default_rng(1)
    datas = [mujoco.MjData(model) for model in (ours, theirs)]
    distance = angle = 0.0
    for _ in range(count):
        q = rng.uniform(ours.jnt_range[:, 0], ours.jnt_range[:, 1])
        for model, data in zip((ours, theirs), datas, strict=True):
            for i in range(ours.njnt):
                data.joint(ours.joint(i).name).qpos[0] = q[i]
            mujoco.mj_kinematics(model, data)
        for arm in description.arms:
            body = ours.body(ours.jnt_bodyid[ours.joint(arm.wrist.joint).id]).name
            R_ours, R_theirs = (data.body(body).xmat.reshape(3, 3) for data in datas)
            wrist_ours = datas[0].site(arm.wrist.name).xpos - datas[0].body("pelvis").xpos
            wrist_theirs = datas[1].body(body).xpos + R_theirs @ arm.wrist.xyz - datas[1].body("pelvis").xpos
            distance = max(distance, float(np.linalg.norm(wrist_ours - wrist_theirs)))
            angle = max(angle, float(np.linalg.norm(R_ours - R_theirs)) / np.sqrt(2.0))
    return distance, angle


def test_same_tree(ours: mujoco.MjModel, theirs: mujoco.MjModel) -> None:
    assert bodies(ours) == bodies(theirs)


def test_same_joints_in_the_same_order(ours: mujoco.MjModel, theirs: mujoco.MjModel) -> None:
    names = [[model.joint(i).name for i in range(model.njnt)] for model in (ours, theirs)]
    assert len(names[0]) == 29
    assert names[0] == names[1]


def test_equal_limits(ours: mujoco.MjModel, theirs: mujoco.MjModel) -> None:
    assert printed(ours.jnt_range) == printed(theirs.jnt_range)


def test_equal_masses(ours: mujoco.MjModel, theirs: mujoco.MjModel) -> None:
    assert printed(ours.body_mass) == printed(theirs.body_mass)
    assert ours.body_mass.sum() == pytest.approx(theirs.body_mass.sum(), abs=1e-6)


def test_equal_centres_of_mass(ours: mujoco.MjModel, theirs: mujoco.MjModel) -> None:
    for body in bodies(ours):
        np.testing.assert_allclose(ours.body(body).ipos, theirs.body(body).ipos, rtol=0.0, atol=1e-7, err_msg=body)


def test_equal_inertias(ours: mujoco.MjModel, theirs: mujoco.MjModel) -> None:
    for body in bodies(ours):
        difference = np.linalg.norm(inertia(ours, body) - inertia(theirs, body))
        assert difference <= INERTIA_TOLERANCE * np.linalg.norm(inertia(theirs, body)), body


def test_equal_wrists(ours: mujoco.MjModel, theirs: mujoco.MjModel, description: RobotDescription) -> None:
    distance, angle = furthest_wrists(ours, theirs, description, 1000)
    print(f"furthest wrists: {1e6 * distance:.2f} um, {1e6 * angle:.2f} urad")
    assert distance <= FK_TOLERANCE
    assert angle <= 1e-5


def test_another_wrist_motor_would_be_noticed(
    ours: mujoco.MjModel, vendor_file: Path, description: RobotDescription
) -> None:
    """Negative control: the 5010 wrist of other G1 variants sits 5 mm further out."""
    spec = vendor.load_without_meshes(vendor_file)
    spec.body("left_wrist_yaw_link").pos = [0.051, 0.0, 0.0]
    distance, _ = furthest_wrists(ours, spec.compile(), description, 10)
    assert distance == pytest.approx(0.005, abs=FK_TOLERANCE)


def test_a_missing_gram_would_be_noticed(ours: mujoco.MjModel, vendor_file: Path) -> None:
    """Negative control: 1 g at the head is 3e-5 of the torso's inertia and 1e-4 of its mass."""
    spec = vendor.load_without_meshes(vendor_file)
    spec.body("torso_link").mass -= 1e-3
    model = spec.compile()
    assert printed(ours.body_mass) != printed(model.body_mass)
