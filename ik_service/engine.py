"""What answers requests: the robot, a solver for each preset, and the description a client gets from `info`."""

from dataclasses import dataclass, replace

import numpy as np

from ik_proto import PROTOCOL_VERSION, Collision, InfoReply, SolveRequest, Status
from ik_proto.robots import RobotDescription, load_description
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.config import DEFAULT_PRESET, Config, ConfigError
from ik_service.gauge import Gauge
from ik_service.kernel import building_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Solution, Solver
from ik_service.velocity import RateController
from ik_service.velocity_kernel import building_velocity_kernel


@dataclass(frozen=True, slots=True)
class Engine:
    """Everything a `Service` answers with. Robot and solvers own buffers, so an engine belongs to one thread.

    Attributes:
        robot: Kinematics and gravity.
        solvers: One for each preset, by name.
        gauge: Measures joint positions that no solver found.
        about: The answer to `info`.
        rate_control: Turns twists into joint velocities.
        collision: What requests that do not say get: "off", "report" or "avoid".
        kernel_note: Why the kernel is not what one would expect; empty when it is.
    """

    robot: Robot
    solvers: dict[str, Solver]
    gauge: Gauge
    about: InfoReply
    rate_control: RateController
    collision: Collision = "avoid"
    kernel_note: str = ""

    @classmethod
    def build(cls, config: Config, boot_id: str, version: str) -> "Engine":
        """Load what the settings name.

        Args:
            config: The settings: robot, preset, collision, kernel.
            boot_id: Random name of this run.
            version: Version of the service.

        Returns:
            An engine with every preset of the robot's description.

        Raises:
            RobotError: The robot cannot be loaded, or has no such preset.
            ConfigError: No preset is named and it is not plain which to take, or the compiled kernel was asked for and
                cannot be had.
        """
        description = load_description(config.robot)
        robot = Robot.load(description)
        default = _default_preset(description, config.preset)
        presets = [Preset.of(description, name) for name in description.presets]
        compiled = config.kernel != "vm"
        # Where both have to be compiled, they are at the same time.
        with building_kernel(robot, compiled) as solving, building_velocity_kernel(robot, compiled) as moving:
            kernel, rate_kernel = solving(), moving()
        kind, note = kernel.kind if kernel.kind == rate_kernel.kind else "vm", kernel.note or rate_kernel.note
        if config.kernel == "c" and kind != "c":
            raise ConfigError(f"--kernel c is not possible here: {note}")
        return cls(
            robot,
            {preset.name: Solver(robot, kernel, preset) for preset in presets},
            Gauge(robot, kernel),
            _about(description, robot, default, kind, boot_id, version),
            RateController(robot, rate_kernel),
            config.collision,
            note,
        )

    def copy(self) -> "Engine":
        """Make an engine for another thread; the kernel is shared."""
        robot = self.robot.copy()
        return replace(
            self,
            robot=robot,
            solvers={name: Solver(robot, solver.kernel, solver.preset) for name, solver in self.solvers.items()},
            gauge=self.gauge.copy(),
            rate_control=RateController(robot, self.rate_control.kernel),
        )

    def warm_up(self) -> None:
        """Solve once with every preset and move once, so that no client pays for first use."""
        q = np.clip(np.zeros(self.robot.nq), self.robot.lower, self.robot.upper)
        left, right = self.robot.fk(q)
        for solver in self.solvers.values():
            solver.solve(left, right, q, collision=self.collision)
        self.rate_control.solve(np.zeros(3), np.zeros(3), q, collision=self.collision)

    def smoothed(
        self, solution: Solution, request: SolveRequest, collision: Collision, smoothing: WeightedMovingFilter
    ) -> Solution:
        """Filter a solution, and tell the truth about the filtered one.

        A mean of safe postures need not be safe. Where collisions are avoided and the filter would take clearance away
        that the margin asks for, the solution stays as it is.

        Args:
            solution: A solution that may be followed.
            request: What it solves.
            collision: What the request wants done about collisions.
            smoothing: The filter, which takes the solution's q as its next sample.

        Returns:
            The filtered joints, with their own errors, torques and clearance. Its status still says whether the target
            was reached.
        """
        robot = self.robot
        # A mean of values within the limits is within them, but for rounding.
        q = np.clip(smoothing(solution.q), robot.lower, robot.upper)
        measured = self.gauge.measure(request.left_wrist, request.right_wrist, q, collision, request.waist)
        if collision == "avoid" and measured.clearance < min(robot.collision.margin, solution.clearance):
            return solution
        return replace(
            solution,
            q=q,
            tau=measured.tau,
            position_error=measured.position_error,
            rotation_error=measured.rotation_error,
            clearance=measured.clearance,
            nearest=measured.nearest,
        )


def _default_preset(description: RobotDescription, wanted: str) -> str:
    """The preset of requests that name none; an empty wish stands for `DEFAULT_PRESET` or the robot's only one."""
    presets = list(description.presets)
    if not wanted and DEFAULT_PRESET not in presets:
        if len(presets) != 1:
            known = ", ".join(sorted(presets)) or "none"
            raise ConfigError(
                f"robot {description.name} has no preset {DEFAULT_PRESET}: name one with --preset ({known})"
            )
        return presets[0]
    return Preset.of(description, wanted or DEFAULT_PRESET).name  # says in one line that there is no such preset


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
        waist_joints=list(robot.waist.joint_names),
        margin=robot.collision.margin,
        capsules=[capsule.name for capsule in robot.collision.capsules],
    )
