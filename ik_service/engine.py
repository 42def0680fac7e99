"""What answers requests: the robot, a solver for each preset, and the description a client gets from `info`."""

from dataclasses import dataclass, replace

import numpy as np

from ik_proto import PROTOCOL_VERSION, InfoReply, SolveRequest, Status
from ik_proto.robots import RobotDescription, load_description
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.config import Config, ConfigError
from ik_service.kernel import load_kernel
from ik_service.objective import Preset
from ik_service.robot import Robot
from ik_service.solver import Solution, Solver


@dataclass(frozen=True, slots=True)
class Engine:
    """Everything a `Service` answers with. Robot and solvers own buffers, so an engine belongs to one thread.

    Attributes:
        robot: Kinematics and gravity.
        solvers: One for each preset, by name.
        about: The answer to `info`.
        kernel_note: Why the kernel is not what one would expect; empty when it is.
    """

    robot: Robot
    solvers: dict[str, Solver]
    about: InfoReply
    kernel_note: str = ""

    @classmethod
    def build(cls, config: Config, boot_id: str, version: str) -> "Engine":
        """Load what the settings name.

        Args:
            config: The settings: robot, preset, kernel.
            boot_id: Random name of this run.
            version: Version of the service.

        Returns:
            An engine with every preset of the robot's description.

        Raises:
            RobotError: The robot cannot be loaded, or has no such preset.
            ConfigError: The compiled kernel was asked for and cannot be had.
        """
        description = load_description(config.robot)
        robot = Robot.load(description)
        Preset.of(description, config.preset)  # says in one line that there is no such preset
        presets = [Preset.of(description, name) for name in description.presets]
        kernels = [load_kernel(robot, preset, compiled=config.kernel != "vm") for preset in presets]
        note = next((kernel.note for kernel in kernels if kernel.note), "")
        kind = "c" if all(kernel.kind == "c" for kernel in kernels) else "vm"
        if config.kernel == "c" and kind != "c":
            raise ConfigError(f"--kernel c is not possible here: {note}")
        return cls(
            robot,
            {kernel.preset.name: Solver(robot, kernel) for kernel in kernels},
            _about(description, robot, config.preset, kind, boot_id, version),
            note,
        )

    def copy(self) -> "Engine":
        """Make an engine for another thread; the kernels are shared."""
        robot = self.robot.copy()
        return replace(
            self, robot=robot, solvers={name: Solver(robot, solver.kernel) for name, solver in self.solvers.items()}
        )

    def warm_up(self) -> None:
        """Solve once with every preset, so that no client pays for first use."""
        q = np.clip(np.zeros(self.robot.nq), self.robot.lower, self.robot.upper)
        left, right = self.robot.fk(q)
        for solver in self.solvers.values():
            solver.solve(left, right, q)

    def smoothed(self, solution: Solution, request: SolveRequest, smoothing: WeightedMovingFilter) -> Solution:
        """Filter a solution, and tell the truth about the filtered one.

        Args:
            solution: A solution that may be followed.
            request: What it solves.
            smoothing: The filter, which takes the solution's q as its next sample.

        Returns:
            The filtered joints, with their own errors and torques. Its status still says whether the target was
            reached.
        """
        robot = self.robot
        # A mean of values within the limits is within them, but for rounding.
        q = np.clip(smoothing(solution.q), robot.lower, robot.upper)
        position_error, rotation_error = robot.wrist_errors(q, request.left_wrist, request.right_wrist)
        return replace(
            solution,
            q=q,
            tau=robot.gravity_torque(q),
            position_error=position_error,
            rotation_error=rotation_error,
        )


def _about(
    description: RobotDescription, robot: Robot, preset: str, kernel: str, boot_id: str, version: str
) -> InfoReply:
    return InfoReply(
        success=True,
        error="",
        status=Status.OK,
        boot_id=boot_id,
        protocol=PROTOCOL_VERSION,
        version=version,
        robot=robot.name,
        model_hash=robot.model_hash,
        joint_names=list(robot.joint_names),
        lower=robot.lower,
        upper=robot.upper,
        velocity=np.array([description.joint(name).velocity for name in robot.joint_names]),
        shoulders=np.stack([arm.shoulder for arm in robot.arms]),
        reach=np.array([arm.reach for arm in robot.arms]),
        presets=list(description.presets),
        default_preset=preset,
        kernel=kernel,
    )
