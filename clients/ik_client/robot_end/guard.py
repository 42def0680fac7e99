"""The guard: the robot's own end of the teleop loop, with the last watchdog and the last limiter. No I/O, no clock.

    commands ─> size, finite? ─> lease ─> states ─> limiter, torque, weight ─> set-point, every control tick

- Whatever dies on the way here, a loop, a service, a network, only stops commands. Then the arms brake within their
  limits and hold, gravity torque kept; they are never given back for it, and never go home.
- Following takes a deliberate engagement that is seen here, in this session, on arms that are ready: `engaged` false,
  then true. So nothing moves after a start, a restart or a silence until an operator has gripped anew.
- Times are the robot's own: what counts is when a command came, not when it was sent.
- What is no command for this robot is counted and otherwise as if it had not come.

The states are those of `states.TABLE`. Call `offer` for every command that comes and `step` in every control tick, both
from one thread, and give the motors what `step` returns.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ik_client.joint_limiter import MotionLimits, interval
from ik_client.robot_end.held_torque import HeldTorque
from ik_client.robot_end.lease import Lease, Reception
from ik_client.robot_end.setpoint_limiter import SetpointLimiter
from ik_client.robot_end.states import TRANSITIONS, EndEvent, EndState
from ik_client.robot_end.weight import WeightRamp
from ik_client.types import Command, RobotState
from ik_proto import Array

AGREEMENT = 0.1
"""Largest difference of a joint with which a command agrees with where the arms are [rad]."""

HOLD_AFTER = 0.1
"""How late a command may be before the arms brake and hold [s]."""

DISARM_AFTER = 0.5
"""How late a command may be before following takes a new engagement [s]."""

RAMP = 2.0
"""How long the weight takes from 0 to 1, and back [s]."""

BUSY = "busy: another session holds the robot"

_ABSURD = 1e6
"""A joint [rad] or torque [N m] beyond this is a fault of the source, not a command."""

_FOLLOWS = frozenset({EndState.FOLLOWING, EndState.HOLDING})
_UNDER_WEIGHT = {EndState.TAKING, EndState.READY, EndState.FOLLOWING, EndState.HOLDING}
_NOTES = {
    EndState.RELEASED: "released: taken by commands that agree with where the arms are",
    EndState.TAKING: "taking the arms",
    EndState.RELEASING: "giving the arms back",
}
_REASONS = {
    EndEvent.RESTARTED: "another run of the service commands: engage again",
    EndEvent.GONE: f"no command for {DISARM_AFTER:g} s: engage again",
    EndEvent.SILENT: f"no command for {HOLD_AFTER:g} s",
}


@dataclass(frozen=True, slots=True, eq=False)
class Setpoint:
    """What the motors shall do in a control tick.

    Attributes:
        q: Joint positions, shape (n,) [rad]. Of no account while the weight is 0.
        tau: Feed-forward torque, shape (n,) [N m].
        weight: How much of this counts against the onboard controller's own, 0 to 1.
        state: The state it comes from.
        note: Why the commands are not followed; empty where they are, or where nothing is wrong.
    """

    q: Array
    tau: Array
    weight: float
    state: EndState
    note: str


class RobotGuard:
    """Turns commands into set-points.

    Attributes:
        tally: How many commands met each `Reception`, and how often each state was entered, by their words; and, as
            "disarmed", how often following ended without the operator's doing.
    """

    def __init__(
        self,
        n: int,
        period: float,
        limits: MotionLimits | None = None,
        *,
        lower: Array | None = None,
        upper: Array | None = None,
        ramp: float = RAMP,
    ) -> None:
        """Start released.

        Args:
            n: Number of joints.
            period: Time between two control ticks [s], about that between two commands.
            limits: Bounds of the motion.
            lower: Lower joint limits, shape (n,) [rad]; None for no limits.
            upper: Upper joint limits, shape (n,) [rad]; None for no limits.
            ramp: How long the weight takes from 0 to 1, and back [s].

        Raises:
            ImportError: ruckig is not installed.
            ValueError: A bound or a time is not positive, or the joint limits leave a joint no range.
        """
        self.tally: Counter[str] = Counter()
        self._n = n
        self._period = period
        self._limiter = SetpointLimiter(n, period, limits, lower=lower, upper=upper)
        self._torque = HeldTorque(n)
        self._weight = WeightRamp(ramp)
        self._lease = Lease()
        self._state = EndState.RELEASED
        self._note = _NOTES[EndState.RELEASED]
        self._q_measured = np.full(n, np.nan)
        self._command: Command | None = None
        self._heard = -np.inf
        self._armed = False
        """Whether a command of this session has said, since following was last possible, that nobody is engaged."""
        self._followed = ""
        """The session that was followed last."""
        self._boot_id = ""
        self._retired = False

    @property
    def state(self) -> EndState:
        """The state."""
        return self._state

    @property
    def weight(self) -> float:
        """The weight of the last set-point, 0 to 1."""
        return self._weight.value

    def offer(self, command: Command, now: float) -> Reception:
        """Take a command.

        Args:
            command: What a loop wants.
            now: When it came [s], monotonic, by the robot's own clock.

        Returns:
            What became of it.
        """
        reception = self._receive(command, now)
        self.tally[reception] += 1
        return reception

    def step(self, now: float, q_measured: Array, dt: float | None = None) -> Setpoint:
        """Go on by a control tick.

        Args:
            now: Time [s], monotonic, by the robot's own clock.
            q_measured: Measured joint positions, shape (n,) [rad]; where they are not finite, no arms are taken.
            dt: Time since the last tick [s], taken as within half a period and two; None for a period. The bounds of
                the motion are kept in this time.

        Returns:
            What to give the motors.

        Raises:
            ValueError: The measured joints are not n numbers.
        """
        self._q_measured = np.array(q_measured, dtype=np.float64)
        if self._q_measured.shape != (self._n,):
            raise ValueError(f"{self._n} measured joints are needed, not {self._q_measured.shape}")
        self._notice_silence(now)
        if self._state is EndState.RELEASED:
            return Setpoint(self._q_measured.copy(), np.zeros(self._n), 0.0, self._state, self._note)
        dt = interval(dt, self._period)
        q, tau = self._move(now, dt)
        goal = 1.0 if self._state in _UNDER_WEIGHT else 0.0
        weight = self._weight.step(goal, dt)
        if weight == goal:
            self._happen(EndEvent.RAMPED)
        return Setpoint(q, tau, weight, self._state, self._note)

    def release(self) -> None:
        """Give the arms back, for the program ends: the weight sinks to 0 from here, and no command takes them again.

        Go on with `step` until its weight is 0.
        """
        self._retired = True
        self._happen(EndEvent.RELEASE)

    def busy_for(self, session: str, now: float) -> bool:
        """Whether another session holds the robot.

        Args:
            session: The one that asks.
            now: Time [s], monotonic.
        """
        return self._lease.busy_for(session, now)

    def report(self, q: Array, dq: Array, time: float, waist: Array | None, busy: bool = False) -> RobotState:
        """What to tell a source.

        Args:
            q: Measured joint positions, shape (n,) [rad].
            dq: Measured joint velocities, shape (n,) [rad/s].
            time: When they were measured [s].
            waist: Measured waist joints, shape (w,) [rad]; None where the waist stays straight.
            busy: Whether another session than the source's holds the robot.
        """
        return RobotState(
            q,
            dq,
            time,
            waist=waist,
            q_set=None if self._state is EndState.RELEASED else self._limiter.q,
            tau_set=None if self._state is EndState.RELEASED else self._torque.value,
            ready=not busy and (self._state is EndState.READY or self._state in _FOLLOWS),
            following=not busy and self._state is EndState.FOLLOWING,
            note=BUSY if busy else self._note,
        )

    def _receive(self, command: Command, now: float) -> Reception:
        if not all(_sound(vector, self._n) for vector in (command.q, command.tau)):
            return Reception.BAD
        self._notice_silence(now)
        reception = self._lease.admit(command.session, command.seq, now)
        if reception is not Reception.ACCEPTED:
            return reception
        if self._command is None or self._command.session != command.session:
            self._armed = False  # A new session: an engagement counts from here on only.
        self._command, self._heard = command, now
        for event in self._events(command):
            self._happen(event)
        return reception

    def _events(self, command: Command) -> list[EndEvent]:
        """The event of a command, and whether it may take the arms."""
        rises = self._armed and command.engaged
        self._armed = not command.engaged
        restarted = command.boot_id not in ("", self._boot_id) and self._boot_id != ""
        self._boot_id = command.boot_id or self._boot_id
        if command.release:
            return [EndEvent.RELEASE]
        if not command.engaged:
            event = EndEvent.DISENGAGED
        elif restarted and self._state in _FOLLOWS:
            event = EndEvent.RESTARTED
        elif rises and self._state is EndState.READY and not _agree(command.q, self._limiter.q):
            self._note = f"engaged more than {AGREEMENT:g} rad from where the arms are held: engage again"
            return []
        else:
            event = EndEvent.ENGAGED if rises else EndEvent.FRESH
        takes = not self._retired and _agree(command.q, self._q_measured)
        return [event, EndEvent.AGREES] if takes else [event]

    def _notice_silence(self, now: float) -> None:
        silence = now - self._heard
        # Written so that a clock that stepped back, or NaN, counts as silence.
        if not 0.0 <= silence <= DISARM_AFTER:
            self._armed = False
            self._happen(EndEvent.GONE)
        elif silence > HOLD_AFTER:
            self._happen(EndEvent.SILENT)

    def _happen(self, event: EndEvent) -> None:
        before, self._state = self._state, TRANSITIONS[self._state][event]
        if self._state is before:
            return
        self.tally[self._state] += 1
        self._note = _NOTES.get(self._state) or _REASONS.get(event, "")
        if before in _FOLLOWS and event in (EndEvent.RESTARTED, EndEvent.GONE):
            self.tally["disarmed"] += 1
        if self._state is EndState.TAKING:
            self._limiter.start(self._q_measured)
            self._torque.reset()
        elif self._state is EndState.FOLLOWING and self._command is not None:
            self._followed = self._command.session
        elif self._state is EndState.RELEASED:
            self._lease.free()

    def _move(self, now: float, dt: float) -> tuple[Array, Array]:
        """The set-point's joints [rad] and torque [N m]."""
        command, q_last = self._command, self._limiter.q
        if command is None or self._state is not EndState.FOLLOWING:
            q = self._limiter.step(np.full(self._n, np.nan), dt)
            # A source that was followed, and goes along now, knows the gravity torque of where the arms are held. One
            # that has just begun may not: the arms would sag by its mere presence.
            knows = command is not None and 0.0 <= now - self._heard <= HOLD_AFTER and _agree(command.q, q)
            if command is None or not knows or command.session != self._followed or self._state is EndState.RELEASING:
                return q, self._torque.value
            return q, self._torque.step(command.tau, 1.0, dt)
        q = self._limiter.step(command.q, dt)
        way = float(np.max(np.abs(command.q - q_last)))
        progress = min(1.0, float(np.max(np.abs(q - q_last))) / way) if way > 0.0 else 1.0
        return q, self._torque.step(command.tau, progress, dt)


def _sound(vector: Array, n: int) -> bool:
    """Whether a command's vector has n numbers that make sense; written so that NaN does not."""
    return np.shape(vector) == (n,) and bool(np.all(np.abs(vector) <= _ABSURD))


def _agree(q: Array, q_where: Array) -> bool:
    """Whether a command is close to where the arms are; never where that is not known."""
    return bool(np.all(np.abs(q - q_where) <= AGREEMENT))
