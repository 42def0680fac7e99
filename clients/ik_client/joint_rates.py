"""How the joints of a rate loop shall move: a tick's twists in, one question to the service, joint velocities out."""

import numpy as np

from ik_client.joint_limiter import JointLimiter
from ik_client.partners import Partners
from ik_client.rate_types import RateKinematics, RateLaw
from ik_client.tick import Hold, Tick, usable
from ik_client.types import Command
from ik_proto import Array, Frame, VelocityReply

_TOO_FAST = 1.01
"""An answer faster than was allowed by more than this factor is none."""


class JointRates:
    """Asks the service how the joints shall move."""

    def __init__(self, ik: RateKinematics, partners: Partners, law: RateLaw, limiter: JointLimiter) -> None:
        """Take whom to ask, and how.

        Args:
            ik: The service.
            partners: Takes note of how it answers.
            law: How twists become joint velocities.
            limiter: Knows how the joints move, and how long a tick is.
        """
        self._ik = ik
        self._partners = partners
        self._law = law
        self._limiter = limiter

    def asked(self, tick: Tick, last: Command, twists: Array, frame: Frame = "pelvis") -> VelocityReply:
        """The service's answer to two twists.

        Args:
            tick: What was measured; takes how long it took.
            last: The last command.
            twists: Of the left and of the right wrist, shape (2, 6) [m/s, rad/s].
            frame: Along whose axes they are given.

        Raises:
            Exception: There is none.
        """
        return self._partners.ask_timed(
            tick,
            lambda: self._ik.velocity(
                twists[0],
                twists[1],
                last.q,
                self._limiter.velocity,
                frame=frame,
                period=self._limiter.period,
                waist=tick.waist,
                **self._law.options,
            ),
        )

    def answered(self, reply: VelocityReply, n: int, now: float) -> Array:
        """The velocities of an answer, shape (n,) [rad/s].

        Args:
            reply: The answer.
            n: Number of joints.
            now: Time of the tick [s].

        Raises:
            Hold: They cannot be followed.
        """
        return self._partners.solution(reply, now, lambda: self._read(reply, n))

    def ramped(self, wanted: Array) -> Array:
        """A velocity towards the wanted one, no faster than the largest acceleration, all joints by the same share.

        The service does so with its answers; where each joint was left to the limiter, the way would be bent.

        Args:
            wanted: Joint velocities, shape (n,) [rad/s].
        """
        velocity = self._limiter.velocity
        change = wanted - velocity
        most = self._law.max_acceleration * self._limiter.period
        return velocity + change * min(1.0, most / max(float(np.abs(change).max()), 1e-12))

    def _read(self, reply: VelocityReply, n: int) -> Array:
        dq = usable(reply.dq, n, "the answer")
        if np.abs(dq).max() > _TOO_FAST * max(self._law.max_speed, float(np.abs(self._limiter.velocity).max())):
            raise Hold("the answer is faster than was allowed")
        return dq
