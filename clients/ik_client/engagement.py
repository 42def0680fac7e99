"""One arm's way from a hand to a target: gate, hold-to-run switch, state machine, authority, clutch. No I/O, no clock.

    sample ─> gate ─> switch ─> state machine ─> authority ─> clutch ─> target, or none

- There is a target in ACTIVE only. Without one the arm brakes within its limits and holds.
- Entering ACTIVE always takes a fresh snapshot, so its first target is where the wrist is already.
- Nothing raises but programming errors: what goes wrong with a hand, a service or a robot is an argument, and ends in
  a state.
"""

from collections.abc import Callable
from dataclasses import dataclass

from ik_client.absolute_clutch import ABSOLUTE_FALL, AbsoluteClutch
from ik_client.authority import Authority
from ik_client.clutch import Clutch
from ik_client.gate import PoseGate, Verdict
from ik_client.hand import HandSample
from ik_client.hold_to_run import HoldToRun
from ik_client.state_machine import ArmState, Event, Seen, StateMachine
from ik_proto import Array

_REASONS = {
    Event.CLEAR: "the fault is cleared: let go, then grip to engage",
    Event.RELEASED: "the grip was released",
    Event.PRESSED: "gripped: waiting until command and measurement agree",
}


@dataclass(frozen=True, slots=True, eq=False)
class ArmStep:
    """What a tick did with an arm.

    Attributes:
        state: The arm's state.
        event: What led there.
        reason: What led to this state; empty in ACTIVE. Stays the same while the state does.
        verdict: What the gate thinks of the hand.
        authority: How much of the hand's motion is followed, 0 to 1.
        target: Where the wrist shall be, `T_pelvis_wrist`, shape (4, 4) [m]; None where the arm holds.
    """

    state: ArmState
    event: Event
    reason: str
    verdict: Verdict
    authority: float
    target: Array | None = None


class ArmEngagement:
    """Decides in every tick whether an arm follows, and what."""

    def __init__(
        self,
        *,
        gate: PoseGate | None = None,
        clutch: Clutch | AbsoluteClutch | None = None,
        machine: StateMachine | None = None,
        authority: Authority | None = None,
    ) -> None:
        """Put the parts together, disarmed.

        Args:
            gate: Judges the hand.
            clutch: Maps the hand to the wrist: its motion, or its place.
            machine: The states.
            authority: The ramp.
        """
        self._gate = gate or PoseGate()
        self._switch = HoldToRun()
        self._machine = machine or StateMachine()
        self._authority = authority or Authority()
        self._clutch = clutch or Clutch()
        self._verdict = Verdict.MISSING
        self._reason = "not engaged: grip to engage"

    @classmethod
    def absolute(cls, gate: PoseGate | None = None) -> "ArmEngagement":
        """For a tracker that is taken at its word: the wrist goes where the hand is; see `AbsoluteClutch`.

        Args:
            gate: Judges the hand.
        """
        return cls(gate=gate, clutch=AbsoluteClutch(), authority=Authority(fall=ABSOLUTE_FALL))

    @property
    def state(self) -> ArmState:
        """The arm's state."""
        return self._machine.state

    def step(
        self,
        sample: HandSample | None,
        now: float,
        *,
        wrist: Callable[[], Array],
        aligned: bool,
        trouble: str = "",
        revoked: str = "",
        fault: str = "",
        clear: bool = False,
    ) -> ArmStep:
        """Go on by a tick.

        Args:
            sample: The tracker's latest look at the hand; None where there is none.
            now: Time of the tick [s], monotonic.
            wrist: Gives `T_pelvis_wrist` of where the arm comes to rest; called only when a snapshot is due. Where it
                raises, or gives no pose, the arm does not become active.
            aligned: Whether the arm's commanded and measured joints agree.
            trouble: Why the arm cannot follow although the hand is fine, such as a service that does not answer.
            revoked: Why the grip counts no longer, such as another service that answers now.
            fault: What a person must look at.
            clear: Whether a person clears the fault.

        Returns:
            The state, its reason, and the target where there is one.
        """
        gated = self._gate.check(sample, now)
        self._verdict = gated.verdict
        followable = gated.pose is not None and not trouble
        grip = self._switch.update(sample.grip if sample else None, followable)
        seen = Seen(
            grip, followable, aligned, revoked=bool(revoked) or gated.verdict.revokes, fault=bool(fault), clear=clear
        )
        event = self._machine.event(seen, now)
        if gated.pose is not None and self._begins(event):
            # Whatever keeps the wrist's pose from us, the arm must not start without it.
            try:
                self._clutch.engage(gated.pose, wrist())
            except Exception as error:
                event, trouble = Event.LOST, f"no snapshot of the wrist: {' '.join(str(error).split())}"
        hand = f"the hand is {gated.verdict}"
        why = {
            Event.FAULT: fault,
            Event.REVOKED: revoked or hand,
            Event.TIMEOUT: f"{self._machine.state} for too long",
            Event.LOST: trouble or hand,
        }
        return self._finish(event, why.get(event) or _REASONS.get(event, ""), now, gated.pose)

    def stop(self, now: float, reason: str = "stopped") -> ArmStep:
        """Disarm at once; the state has changed when this returns. Following again takes a new grip.

        Args:
            now: Time [s], monotonic.
            reason: Why.

        Returns:
            The step: disarmed, or still in fault where it was.
        """
        return self._finish(Event.REVOKED, reason, now, None)

    def _begins(self, event: Event) -> bool:
        return self._machine.state is not ArmState.ACTIVE and self._machine.next(event) is ArmState.ACTIVE

    def _finish(self, event: Event, why: str, now: float, pose: Array | None) -> ArmStep:
        before = self._machine.state
        state = self._machine.step(event, now)
        if state is not before:
            self._reason = why if state is not ArmState.ACTIVE else ""
        authority = self._authority.update(state, now)
        target = None
        if state is ArmState.ACTIVE and pose is not None:
            target = self._clutch.follow(pose, authority)
        else:
            self._clutch.release()
        return ArmStep(state, event, self._reason, self._verdict, authority, target)
