"""Kills a service in the middle of a run and starts it again, to show that the robot holds and resumes."""

from sim_client.service_process import ServiceProcess
from sim_client.trace import Tick


class Outage:
    """Observer that acts at two simulated times."""

    def __init__(self, service: ServiceProcess, kill_at: float, restart_at: float) -> None:
        """Plan the outage.

        Args:
            service: The victim.
            kill_at: When to kill it [s].
            restart_at: When to start it again [s].
        """
        self._service = service
        self._kill_at = kill_at
        self._restart_at = restart_at
        self._killed = self._restarted = False

    def observe(self, tick: Tick) -> None:
        """Act if it is time."""
        if not self._killed and tick.sim_time >= self._kill_at:
            self._service.kill()
            self._killed = True
        elif self._killed and not self._restarted and tick.sim_time >= self._restart_at:
            self._service.restart()
            self._restarted = True
