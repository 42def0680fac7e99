"""Fixtures of the solver's tests: the G1, its kernels, small made-up robots, and a cost written a second time."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from body_oracle import CapsuleOracle

from ik_proto.robots import RobotDescription, load_description
from ik_service.kernel import Kernel, load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Solver

CostOf = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]


@pytest.fixture(scope="session")
def description() -> RobotDescription:
    return load_description("g1")


@pytest.fixture(scope="session")
def robot(description: RobotDescription) -> Robot:
    return Robot.load(description)


@pytest.fixture(scope="session")
def preset(description: RobotDescription) -> Preset:
    """The seeds' cost, which Ipopt solves as well."""
    return Preset.of(description, "openwbt")


@pytest.fixture(scope="session")
def precise(description: RobotDescription) -> Preset:
    return Preset.of(description, "precise")


@pytest.fixture(scope="session")
def vm_kernel(robot: Robot) -> Kernel:
    return load_kernel(robot, compiled=False)


@pytest.fixture(scope="session")
def kernel(robot: Robot, kernel_cache: Path) -> Kernel:
    """The fastest kernel there is here: generated C, or the virtual machine without a compiler."""
    return load_kernel(robot, folder=kernel_cache)


@pytest.fixture(scope="session")
def c_kernel(kernel: Kernel) -> Kernel:
    """The compiled kernel; tests that need it are skipped where there is no compiler."""
    if kernel.kind != "c":
        pytest.skip(f"no compiled kernel here: {kernel.note}")
    return kernel


@pytest.fixture
def solver(robot: Robot, kernel: Kernel, preset: Preset) -> Solver:
    """Solves with preset `openwbt`."""
    return Solver(robot, kernel, preset)


@pytest.fixture
def precise_solver(robot: Robot, kernel: Kernel, precise: Preset) -> Solver:
    """Solves with preset `precise`."""
    return Solver(robot, kernel, precise)


@pytest.fixture(scope="session")
def oracle(description: RobotDescription) -> CapsuleOracle:
    """The G1's capsules, measured by coal."""
    return CapsuleOracle(description)


@pytest.fixture(scope="session")
def home(description: RobotDescription, robot: Robot) -> np.ndarray:
    """A posture with both arms clear of the body and far from every limit [rad], shape (nq,)."""
    return np.array([description.joints[name].home for name in robot.joint_names])


@pytest.fixture(scope="session")
def front(robot: Robot, home: np.ndarray, oracle: CapsuleOracle) -> np.ndarray:
    """Hands in front of the body, apart, elbows bent [rad], shape (nq,)."""
    q = home.copy()
    for i, name in enumerate(robot.joint_names):
        side = 1.0 if name.startswith("left") else -1.0
        q[i] += -0.6 * name.endswith("shoulder_pitch_joint") - 0.6 * name.endswith("elbow_joint")
        q[i] += 0.2 * side * name.endswith("shoulder_roll_joint")
    assert oracle.clearance(q) > 2.0 * robot.collision.margin
    return q


@pytest.fixture(scope="session")
def clear_postures(robot: Robot, oracle: CapsuleOracle) -> Callable[[int, int], np.ndarray]:
    """(seed, count) -> random postures that are clear by twice the margin [rad], shape (count, nq)."""

    def draw(seed: int, count: int) -> np.ndarray:
        rng, found = np.random.default_rng(seed), []
        while len(found) < count:
            q = rng.uniform(robot.lower, robot.upper)
            if oracle.clearance(q) >= 2.0 * robot.collision.margin:
                found.append(q)
        return np.array(found)

    return draw


@pytest.fixture(scope="session")
def cost_of(robot: Robot, preset: Preset) -> CostOf:
    """The cost as the seeds write it, from Pinocchio's kinematics and its log3: shares no code with the kernel."""

    def cost(left: np.ndarray, right: np.ndarray, q_last: np.ndarray, q: np.ndarray) -> float:
        total = preset.regularization * q @ q + preset.smoothness * (q - q_last) @ (q - q_last)
        for wrist, target in zip(robot.fk(q), (left, right), strict=True):
            e, w = wrist[:3, 3] - target[:3, 3], pin.log3(wrist[:3, :3] @ target[:3, :3].T)
            total += preset.position * e @ e + preset.rotation * w @ w
        return float(total)

    return cost


URDF_JOINT = """
  <link name="{name}_link"><inertial><mass value="1"/><origin xyz="0.05 0.01 0"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="{name}" type="{type}"><parent link="{parent}"/><child link="{name}_link"/>
    <origin xyz="{xyz}" rpy="0.1 0.2 0.3"/><axis xyz="{axis}"/>
    <limit lower="-2" upper="2.5" effort="10" velocity="5"/></joint>"""

ARM_TOML = """
[[arms]]
side = "{side}"
joints = {joints}
[arms.wrist]
name = "{side}_tool"
joint = "{last}"
xyz = [0.1, 0.0, 0.02]
rpy = [0.3, 0.1, -0.2]
"""

PRESET_TOML = """
[presets.openwbt]
position = 50.0
rotation = 1.0
regularization = 0.02
smoothness = 0.1
"""

ARMOUR_TOML = """
[collision]
margin = 0.02
ignored = [
    { pair = ["trunk", "a_1"], reason = "joined by the shoulder" },
    { pair = ["trunk", "z_1"], reason = "joined by the shoulder" },
]
[[collision.capsules]]
name = "trunk"
body = "trunk"
from = [0.0, 0.0, 0.0]
to = [0.0, 0.0, 0.3]
radius = 0.1
"""

CAPSULE_TOML = """
[[collision.capsules]]
name = "{name}"
body = "{name}"
from = [0.02, 0.0, 0.02]
to = [0.17, 0.01, 0.06]
radius = 0.04
"""

AXES = ("0 1 0", "1 0 0", "0.6 0 0.8", "0 1 0", "1 0 0", "0 0 -1")


def write_robot(
    folder: Path, replace_urdf: tuple[str, str] = ("", ""), replace_toml: tuple[str, str] = ("", "")
) -> Path:
    """Write a two-armed URDF and its TOML; return the TOML.

    Left arm: z_0 to z_3. Right arm: a_0 to a_4, first in Pinocchio's model, which sorts by name. No waist, no elbow,
    no capsules.
    """
    links = ['<link name="trunk"/>']
    left, right = [f"z_{i}" for i in range(4)], [f"a_{i}" for i in range(5)]
    for joints, y in ((left, 0.2), (right, -0.2)):
        parent = "trunk"
        for i, name in enumerate(joints):
            xyz = "0.2 0 0.1" if i else f"0 {y} 0.3"
            links.append(URDF_JOINT.format(name=name, type="revolute", parent=parent, xyz=xyz, axis=AXES[i]))
            parent = f"{name}_link"
    urdf = f'<robot name="made_up">{"".join(links)}</robot>'
    arms = "".join(
        ARM_TOML.format(side=side, joints=joints, last=joints[-1])
        for side, joints in (("left", left), ("right", right))
    )
    toml = f'name = "made_up"\nmodel = "arms.urdf"\nbase = "trunk"\n{arms}{PRESET_TOML}'
    (folder / "arms.urdf").write_text(urdf.replace(*replace_urdf) if replace_urdf[0] else urdf)
    path = folder / "arms.toml"
    path.write_text(toml.replace(*replace_toml) if replace_toml[0] else toml)
    return path


@pytest.fixture
def make_robot(tmp_path: Path) -> Callable[..., Path]:
    """`write_robot` in a folder of the test."""
    return lambda *replacements, **named: write_robot(tmp_path, *replacements, **named)


@pytest.fixture(scope="session")
def small_robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """The robot of `write_robot`: arms of 4 and 5 joints, no waist, no elbow, no capsules."""
    return Robot.load(load_description(write_robot(tmp_path_factory.mktemp("small"))))


@pytest.fixture(scope="session")
def small_kernel(small_robot: Robot) -> Kernel:
    return load_kernel(small_robot, compiled=False)


@pytest.fixture(scope="session")
def armoured(tmp_path_factory: pytest.TempPathFactory) -> RobotDescription:
    """The robot of `write_robot` with capsules: arms of unequal length that can meet the trunk and each other."""
    capsules = ARMOUR_TOML + "".join(CAPSULE_TOML.format(name=name) for name in ("z_1", "z_3", "a_1", "a_4"))
    path = write_robot(tmp_path_factory.mktemp("armoured"), replace_toml=(PRESET_TOML, PRESET_TOML + capsules))
    return load_description(path)
