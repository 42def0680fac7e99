"""Keeps a running server's certificate good: for where this machine is now, and never about to expire."""

import datetime
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from xr_client.certificates import Credentials, ensure_credentials

PERIOD = 60.0
"""How often addresses and expiry are looked at [s]."""


class Renewal:
    """Looks after the certificate from a thread of its own.

    Attributes:
        fault: Why it could not be renewed, in one line; empty where all is well.
    """

    def __init__(
        self,
        folder: Path,
        in_use: Credentials,
        hosts: Callable[[], Sequence[str]],
        speak_for: Sequence[str],
        renewed: Callable[[Credentials, Sequence[str]], None],
        *,
        now: Callable[[], datetime.datetime] = lambda: datetime.datetime.now(datetime.UTC),
    ) -> None:
        """Prepare; `start` begins to look.

        Args:
            folder: Of certificates and keys.
            in_use: What the server began with.
            hosts: Gives the addresses and names that headsets may use at present, the most important first.
            speak_for: Names that a new authority shall speak for.
            renewed: Told of a new certificate, and of the hosts that headsets may use now. Raises where it cannot be
                used; then it is told again.
            now: The time, with a time zone.
        """
        self.fault = ""
        self._folder = folder
        self._leaf = in_use.leaf.read_bytes()
        self._hosts = hosts
        self._speak_for = speak_for
        self._renewed = renewed
        self._now = now
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ik-xr certificates", daemon=True)

    def check(self) -> bool:
        """Renew the certificate where that is due, and take one that another `ik-xr` has renewed.

        Returns:
            Whether there is a new one.
        """
        try:
            hosts = self._hosts()
            made = ensure_credentials(self._folder, hosts, self._speak_for, self._now())
            leaf = made.leaf.read_bytes()
            changed = leaf != self._leaf
            if changed:
                self._renewed(made, hosts)
        except (OSError, ValueError) as error:  # tried again in a minute; what is in use stays in use
            self.fault = " ".join(str(error).split())
            return False
        self._leaf, self.fault = leaf, ""
        return changed

    def start(self) -> None:
        """Look every minute from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Look no more."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._end.wait(PERIOD):
            self.check()
