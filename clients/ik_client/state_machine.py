"""The states of an arm under teleoperation, as one table. Pure: what happens in a tick goes in, the state comes out.

| state    | the arm                                                                      |
|----------|------------------------------------------------------------------------------|
| disarmed | holds; nobody operates it. The state after every start                       |
| aligning | holds; the operator grips, and command and measurement are about to agree    |
| active   | follows the hand from the snapshot taken on entering this state              |
| hold     | holds for a moment; a grip that was never let go may go on                   |
| fault    | holds until a person clears the fault                                        |

In all states but active the arm brakes within its limits and holds its last command. It never goes home by itself.

The events of a tick, the first that applies counts:

| event    | when                                                                                              |
|----------|---------------------------------------------------------------------------------------------------|
| fault    | something is wrong that a person must look at                                                     |
| clear    | a person cleared the fault; counts in fault only                                                  |
| revoked  | the grip counts no longer: stop, another service, a hand that is gone or somewhere else           |
| timeout  | the state lasted longer than it may                                                               |
| released | the hold-to-run switch is open, or its press did not count                                        |
| lost     | the hand cannot be followed in this tick, or the service cannot                                   |
| pressed  | a deliberate press of the hold-to-run switch                                                      |
| aligned  | the switch is held, and the command agrees with the measured joints                               |
| held     | the switch is held                                                                                |

`TABLE` says where each event leads; an empty cell stays.
"""

from dataclasses import dataclass
from enum import StrEnum

from ik_client.hold_to_run import Grip
from ik_client.transition_table import read_table

TABLE = """\
| from     | fault | clear    | revoked  | timeout  | released | lost     | pressed  | aligned | held   |
|----------|-------|----------|----------|----------|----------|----------|----------|---------|--------|
| disarmed | fault |          |          |          |          |          | aligning |         |        |
| aligning | fault |          | disarmed | disarmed | disarmed | disarmed |          | active  |        |
| active   | fault |          | disarmed |          | hold     | hold     | aligning |         |        |
| hold     | fault |          | disarmed | disarmed |          |          | aligning | active  | active |
| fault    |       | disarmed |          |          |          |          |          |         |        |
"""


class ArmState(StrEnum):
    """What an arm does."""

    DISARMED = "disarmed"
    ALIGNING = "aligning"
    ACTIVE = "active"
    HOLD = "hold"
    FAULT = "fault"


class Event(StrEnum):
    """What happens to an arm in a tick, in order of precedence."""

    FAULT = "fault"
    CLEAR = "clear"
    REVOKED = "revoked"
    TIMEOUT = "timeout"
    RELEASED = "released"
    LOST = "lost"
    PRESSED = "pressed"
    ALIGNED = "aligned"
    HELD = "held"


TRANSITIONS = read_table(TABLE, ArmState, Event)
"""`TABLE` as a mapping: state and event to the next state. Complete."""


@dataclass(frozen=True, slots=True)
class Seen:
    """What is the case in a tick.

    Attributes:
        grip: The hold-to-run switch.
        followable: Whether hand and service can be followed.
        aligned: Whether command and measured joints agree.
        revoked: Whether the grip counts no longer.
        fault: Whether something is wrong that a person must look at.
        clear: Whether a person clears the fault.
    """

    grip: Grip
    followable: bool
    aligned: bool
    revoked: bool = False
    fault: bool = False
    clear: bool = False


class StateMachine:
    """Runs one arm through the table.

    Attributes:
        state: The state of the arm.
        time_limits: How long a state may last [s]; those without an entry may last for ever.
    """

    def __init__(self, *, align_limit: float = 2.0, hold_limit: float = 0.5) -> None:
        """Start disarmed.

        Args:
            align_limit: How long ALIGNING may last [s].
            hold_limit: How long HOLD may last [s].
        """
        self.state = ArmState.DISARMED
        self.time_limits = {ArmState.ALIGNING: align_limit, ArmState.HOLD: hold_limit}
        self._since = 0.0

    def event(self, seen: Seen, now: float) -> Event:
        """Say which event counts in this tick; the state does not change.

        Args:
            seen: What is the case.
            now: Time of the tick [s], monotonic.
        """
        limit = self.time_limits.get(self.state)
        # Written so that a clock that stepped back, or NaN, counts as a timeout.
        overdue = limit is not None and not 0.0 <= now - self._since <= limit
        happens = {
            Event.FAULT: seen.fault,
            Event.CLEAR: seen.clear and self.state is ArmState.FAULT,
            Event.REVOKED: seen.revoked,
            Event.TIMEOUT: overdue,
            Event.RELEASED: seen.grip is Grip.RELEASED,
            Event.LOST: not seen.followable,
            Event.PRESSED: seen.grip is Grip.PRESSED,
            Event.ALIGNED: seen.aligned,
        }
        return next((event for event, applies in happens.items() if applies), Event.HELD)

    def next(self, event: Event) -> ArmState:
        """Where an event would lead from here."""
        return TRANSITIONS[self.state][event]

    def step(self, event: Event, now: float) -> ArmState:
        """Go where an event leads.

        Args:
            event: What happens.
            now: Time of the tick [s], monotonic.

        Returns:
            The new state.
        """
        to = self.next(event)
        if to is not self.state:
            self.state, self._since = to, now
        return self.state
