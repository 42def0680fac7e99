"""Authority: how much of the operator's motion an arm follows, from 0 to 1.

It rises while the arm is active, sinks while it holds, and is nothing in every other state. So an engagement begins
softly, a glitch of one tick costs next to nothing, and after a hold as long as the state machine allows it begins at
zero again.
"""

from ik_client.state_machine import ArmState


class Authority:
    """A ramp driven by the state of an arm. One per arm, one update per tick.

    Attributes:
        value: The authority, 0 to 1.
    """

    def __init__(self, rise: float = 1.0, fall: float = 0.5) -> None:
        """Start with none.

        Args:
            rise: Time from none to full in ACTIVE [s].
            fall: Time from full to none in HOLD [s].

        Raises:
            ValueError: A time is not positive.
        """
        if not (rise > 0.0 and fall > 0.0):
            raise ValueError(f"authority must rise and fall in a positive time, not {rise} s and {fall} s")
        self.value = 0.0
        self._rise = rise
        self._fall = fall
        self._last: float | None = None

    def update(self, state: ArmState, now: float) -> float:
        """Go on to this tick.

        Args:
            state: The arm's state in this tick.
            now: Time of the tick [s], monotonic.

        Returns:
            The authority, 0 to 1.
        """
        passed = 0.0 if self._last is None else max(0.0, now - self._last)
        self._last = now
        match state:
            case ArmState.ACTIVE:
                self.value = min(1.0, self.value + passed / self._rise)
            case ArmState.HOLD:
                self.value = max(0.0, self.value - passed / self._fall)
            case _:
                self.value = 0.0
        return self.value
