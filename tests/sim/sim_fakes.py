"""Stand-ins: a clock that is moved by hand, a solver that does as told, and a robot small enough to calculate."""

from collections.abc import Callable

import numpy as np

from ik_client import ArmState, ArmStep, Hands, HandSample
from ik_client.gate import Verdict
from ik_client.state_machine import Event
from ik_proto import Array, ClearanceReply, FkReply, SolveReply, Status

# The right arm comes first in the file, a leg between the arms: order must not matter.
TOY_MODEL = """
<mujoco model="toy">
  <compiler angle="radian"/>
  <worldbody>
    <body name="base" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.1 0.1 0.1" mass="5"/>
      <body name="right_upper" pos="0 -0.2 0">
        <joint name="right_a" axis="0 1 0" range="-2 2" actuatorfrcrange="-6 6" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.5"/>
        <body name="right_lower" pos="0.2 0 0">
          <joint name="right_b" axis="0 0 1" range="-1 1" actuatorfrcrange="-4 4" damping="0.1"/>
          <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.3"/>
        </body>
      </body>
      <body name="leg" pos="0 0 -0.1">
        <joint name="leg" axis="0 1 0" range="-2 2" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1"/>
      </body>
      <body name="left_upper" pos="0 0.2 0">
        <joint name="left_a" axis="0 1 0" range="-2 2" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.5"/>
        <body name="left_lower" pos="0.2 0 0">
          <joint name="left_b" axis="0 0 1" range="-1 1" actuatorfrcrange="-4 4" damping="0.1"/>
          <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.3"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="spring" joint="left_a" kp="500" forcerange="-7 7"/>
  </actuator>
</mujoco>
"""

TOY_TOML = """
name = "toy"
model = "toy.xml"
base = "base"

[[arms]]
side = "left"
joints = ["left_a", "left_b"]
[arms.wrist]
name = "L"
joint = "left_b"
xyz = [0.2, 0.0, 0.0]

[[arms]]
side = "right"
joints = ["right_a", "right_b"]
[arms.wrist]
name = "R"
joint = "right_b"
xyz = [0.2, 0.0, 0.0]
rpy = [0.3, -0.2, 0.1]

[joints.left_a]
kp = 60.0
kd = 2.0
home = 0.4

[joints.right_b]
kp = 20.0
kd = 0.5
home = -0.3

[joints.leg]
kp = 80.0
kd = 3.0
home = 0.2
"""


class FakeClock:
    """Monotonic time that moves only when it is told to, or when somebody sleeps."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.slept = 0.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        assert duration > 0.0
        self.slept += duration
        self.now += duration


class FakeSolver:
    """Answers with the q it is told, after a time on the fake clock, or raises."""

    def __init__(self, clock: FakeClock, answer: Callable[[Array], Array] = lambda q: q, takes: float = 0.001) -> None:
        self.clock = clock
        self.answer = answer
        self.takes = takes
        self.fault: Exception | None = None

    def fk(self, q: Array, waist: Array | None = None) -> FkReply:
        if self.fault is not None:
            raise self.fault
        return FkReply(
            success=True, error="", status=Status.OK, boot_id="first", left_wrist=np.eye(4), right_wrist=np.eye(4)
        )

    def clearance(self, q: Array, waist: Array | None = None) -> ClearanceReply:
        return ClearanceReply(
            success=True,
            error="",
            status=Status.OK,
            boot_id="first",
            clearance=np.full(len(q), 1.0),
            nearest=("a", "b"),
        )

    def solve(self, left_wrist: Array, right_wrist: Array, q: Array, dq: Array, **options: object) -> SolveReply:
        self.clock.now += self.takes
        if self.fault is not None:
            raise self.fault
        return SolveReply(
            success=True,
            error="",
            status=Status.OK,
            boot_id="first",
            sol_q=self.answer(q),
            tau=np.zeros(len(q)),
            position_error=np.array([0.001, 0.002]),
            rotation_error=np.array([0.01, 0.02]),
            solve_us=100.0,
        )


class SteadyHands:
    """Always the same two poses, gripped as soon as the robot is ready."""

    def __init__(self, left: Array, right: Array, ready: Callable[[], bool]) -> None:
        self.left, self.right = left, right
        self.ready = ready

    def hands(self, now: float) -> Hands:
        grip = self.ready()
        return Hands(HandSample(self.left, grip, now), HandSample(self.right, grip, now))


def steps_to(left: Array | None, right: Array | None) -> tuple[ArmStep, ArmStep]:
    """What a report says of two arms that follow these targets; None for one that holds."""
    follows = (ArmState.ACTIVE, Event.HELD, "", Verdict.OK, 1.0)
    holds = (ArmState.DISARMED, Event.RELEASED, "not engaged", Verdict.OK, 0.0)
    first, second = (ArmStep(*(holds if target is None else follows), target) for target in (left, right))
    return first, second
