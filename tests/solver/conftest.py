"""Fixtures of the solver's tests: the G1, its kernels, small made-up robots, and a cost written a second time."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from ik_proto.robots import RobotDescription, load_description
from ik_service.kernel import Kernel, load_kernel
from ik_service.objective import Preset
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
    return Preset.of(description, "openwbt")


@pytest.fixture(scope="session")
def vm_kernel(robot: Robot, preset: Preset) -> Kernel:
    return load_kernel(robot, preset, compiled=False)


@pytest.fixture(scope="session")
def c_kernel(robot: Robot, preset: Preset, tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    """The compiled kernel; tests that need it are skipped where there is no compiler."""
    kernel = load_kernel(robot, preset, folder=tmp_path_factory.mktemp("cache") / "kernels")
    if kernel.kind != "c":
        pytest.skip(f"no compiled kernel here: {kernel.note}")
    return kernel


@pytest.fixture
def solver(robot: Robot, vm_kernel: Kernel) -> Solver:
    return Solver(robot, vm_kernel)


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

AXES = ("0 1 0", "1 0 0", "0.6 0 0.8", "0 1 0", "1 0 0", "0 0 -1")


@pytest.fixture
def make_robot(tmp_path: Path) -> Callable[..., Path]:
    """Write a two-armed URDF and its TOML; return the TOML.

    Left arm: z_0 to z_3. Right arm: a_0 to a_4, first in Pinocchio's model, which sorts by name.
    """

    def write(replace_urdf: tuple[str, str] = ("", ""), replace_toml: tuple[str, str] = ("", "")) -> Path:
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
        (tmp_path / "arms.urdf").write_text(urdf.replace(*replace_urdf) if replace_urdf[0] else urdf)
        path = tmp_path / "arms.toml"
        path.write_text(toml.replace(*replace_toml) if replace_toml[0] else toml)
        return path

    return write
