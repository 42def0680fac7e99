"""Where two arms shall go: a tick's targets in, one solve, joints and torques out.

- The solve starts from the last command while every joint agrees with the measurement, else from the measured joints:
  a solver that starts from a sagging arm creeps after it.
- An arm that holds while the other follows is solved for where it is. Should the answer need it elsewhere, to keep the
  two apart, the other arm waits.
- An arm that is caught far from a target within reach starts where a search has found that it is reached (`ways_out`).
- The measured waist without its swing, and the elbow directions and weights a tracker gives, go with every solve.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ik_client.arm_joints import SIDES, joints_of
from ik_client.partners import Partners
from ik_client.resting_wrists import RestingWrists
from ik_client.tick import Hold, Tick, usable
from ik_client.tick_report import Seed
from ik_client.types import Command, Kinematics, RobotState
from ik_client.ways_out import STARTS, WaysOut
from ik_proto import Array, Collision, SolveReply
from ik_proto.smoothing import WeightedMovingFilter

HELD_STILL = 0.1
"""How far an answer may move a joint of an arm that holds [rad]; beyond, the answer is not for this robot."""


class ArmGoals:
    """Asks the service where the arms shall go."""

    def __init__(
        self,
        ik: Kinematics,
        partners: Partners,
        *,
        smoothing: WeightedMovingFilter | None,
        feed_forward: bool,
        collision: Collision | None,
        agreement: float,
        ways_out: bool,
    ) -> None:
        """Take whom to ask, and how; see `TeleopLoop`.

        Args:
            ik: The service.
            partners: Takes note of how it answers.
            smoothing: Filter over the answers.
            feed_forward: Whether their torque is wanted.
            collision: What to do about self-collision.
            agreement: Largest difference of a joint's command and measurement with which the command counts [rad].
            ways_out: Whether arms that are caught are led out. Whoever moves them must check what is in the way.
        """
        self._ik = ik
        self._partners = partners
        self._smoothing = smoothing
        self._feed_forward = feed_forward
        self._collision: Collision | None = collision
        self._agreement = agreement
        self._wrists = RestingWrists(partners.fk)
        self._ways_out = WaysOut(partners) if ways_out else None
        self._search: Callable[[], SolveReply] | None = None

    def wrist(self, side: int, rest: Array, waist: Array | None) -> Array:
        """Where a wrist is at rest, `T_pelvis_wrist`, shape (4, 4) [m]; raises where the service does not tell."""
        return self._wrists.at(rest, waist)[side]

    def none(self, tick: Tick, last: Command) -> None:
        """Note that no arm has a target, and find out whether a service in trouble is back."""
        if self._smoothing:
            self._smoothing.reset()
        if self._ways_out:
            self._ways_out.forget()
        if self._partners.service.trouble(tick.time):
            try:
                self._partners.fk(last.q, None)
            except Exception as error:
                tick.note(error)

    def of(self, tick: Tick, targets: Sequence[Array | None], rest: Array, last: Command) -> tuple[Array, Array]:
        """The goals of a tick in which an arm has a target.

        Args:
            tick: What was measured and seen; takes the answer.
            targets: `T_pelvis_wrist` of the left and of the right arm [m]; None for an arm that holds.
            rest: Where the joints come to rest, shape (n,) [rad].
            last: The last command.

        Returns:
            Joints to go to, shape (n,) [rad], NaN for an arm that holds; and the torque there, shape (n,) [N m].

        Raises:
            Exception: The tick cannot follow.
        """
        n, measured = len(last.q), tick.measured
        if measured is None:
            raise Hold("the robot cannot be read")
        wanted = [self.wrist(side, rest, tick.waist) if T is None else T for side, T in enumerate(targets)]
        reply = tick.reply = self._solve(tick, wanted, measured, last)
        q, tau = self._partners.solution(reply, tick.time, lambda: self._read(reply, n))
        if self._ways_out:
            self._ways_out.answered(reply, targets, last.q, tick.time)
        if self._smoothing:
            q = self._smoothing(q)
        goal, torque = np.full(n, np.nan), last.tau.copy()
        for side, target in enumerate(targets):
            arm = joints_of(side, n)
            if target is not None:
                goal[arm], torque[arm] = q[arm], tau[arm]
            elif np.max(np.abs(q[arm] - rest[arm])) > HELD_STILL:
                raise Hold(f"the {SIDES[side]} arm, which holds, is in the way")
        return self._ways_out.slowed(last.q, goal, last.tau, torque) if self._ways_out else (goal, torque)

    def look_for_ways_out(self, tick: Tick) -> None:
        """Search for the way out of an arm that is caught, once the tick's command is on its way."""
        if self._ways_out and self._search and tick.reply is not None:
            self._ways_out.look(self._search, tick.time)

    def _read(self, reply: SolveReply, n: int) -> tuple[Array, Array]:
        q = usable(reply.sol_q, n, "the answer")
        return q, usable(reply.tau, n, "the answer's torque") if self._feed_forward else np.zeros(n)

    def _solve(self, tick: Tick, targets: list[Array], measured: RobotState, last: Command) -> SolveReply:
        agrees = bool(np.all(np.abs(last.q - measured.q) <= self._agreement))
        tick.seed, q = (Seed.COMMAND, last.q) if agrees else (Seed.MEASURED, measured.q)
        if self._ways_out and self._ways_out.under_way:
            tick.seed, q = Seed.FOUND, self._ways_out.start(q)
        hints: dict[str, Any] = {
            "waist": tick.waist,
            "left_elbow": tick.hands.left_elbow,
            "right_elbow": tick.hands.right_elbow,
            "weights": tick.hands.weights,
            "collision": self._collision,
        }
        self._search = lambda: self._ik.solve(*targets, q, measured.dq, mode="reach", starts=STARTS, **hints)
        return self._partners.ask_timed(tick, lambda: self._ik.solve(*targets, q, measured.dq, **hints))
