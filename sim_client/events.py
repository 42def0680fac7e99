"""Tells a person when the loop begins to hold and when it follows again: one line each, not one a tick."""

from collections.abc import Callable

from sim_client.trace import Tick


class Announcer:
    """Observer that reports changes between holding and following.

    Attributes:
        lines: Everything announced so far.
    """

    def __init__(self, say: Callable[[str], None], boot_id: str = "") -> None:
        """Begin.

        Args:
            say: Told each line.
            boot_id: The run of the service that answered before the first tick.
        """
        self.lines: list[str] = []
        self._say = say
        self._reason = ""
        self._since = 0.0
        self._boot_id = boot_id

    def observe(self, tick: Tick) -> None:
        """Announce a change, if this tick is one."""
        reason = tick.report.reason if tick.holding else ""
        boot_id = tick.report.boot_id
        if reason and not self._reason:
            self._since = tick.sim_time
            self._announce(tick, f"holding the last command: {reason}")
        elif self._reason and not reason:
            self._announce(tick, f"following after {tick.sim_time - self._since:.2f} s")
        if boot_id and boot_id != self._boot_id:
            if self._boot_id:
                self._announce(tick, "the service was restarted")
            self._boot_id = boot_id
        self._reason = reason

    def _announce(self, tick: Tick, text: str) -> None:
        line = f"{tick.sim_time:7.2f} s  {text}"
        self.lines.append(line)
        self._say(line)
