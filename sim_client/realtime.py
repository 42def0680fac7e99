"""Runs teleop loop and physics in step with the clock.

- Ticks are due on a schedule that is fixed when the run begins, so that oversleeping never adds up.
- A tick is: solve and command (bounded by the client's timeout, which must be shorter than a tick), then physics. So a
  dead or hung service delays a tick by less than its period and never stops the physics.
- A tick that ends after the next one is due is late; the ticks after it follow without a pause until they are on
  schedule again. After a gap longer than `MAX_BACKLOG` (a suspended machine) the schedule is moved instead: the robot
  is not rushed through the missed time, and the real-time factor shows the loss.
- Observers (display, window, recorder) are called in the pause after a tick, in turn.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ik_client import TeleopLoop
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.trace import Tick

MAX_BACKLOG = 0.5
"""How far behind schedule a run tries to catch up [s]."""


class Observer(Protocol):
    """Looks at every tick."""

    def observe(self, tick: Tick) -> None:
        """Take note of a tick; what takes long disturbs the next one."""
        ...


@dataclass(frozen=True, slots=True)
class Pace:
    """How a run kept time.

    Attributes:
        ticks: Ticks run.
        simulated: Simulated time [s].
        elapsed: Wall time from the begin of the first tick to the end of the last [s].
        busy: Wall time spent in ticks, waiting for the service included [s].
        late_ticks: Ticks that ended after the next one was due.
        moved: How often the schedule was moved because the backlog was too long.
    """

    ticks: int
    simulated: float
    elapsed: float
    busy: float
    late_ticks: int
    moved: int

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall time; 1 is real time, less is too slow."""
        return self.simulated / self.elapsed if self.elapsed > 0.0 else 0.0

    @property
    def headroom(self) -> float:
        """Simulated time over busy time: how much faster it could have run."""
        return self.simulated / self.busy if self.busy > 0.0 else 0.0


class Runner:
    """Runs a loop and a robot together."""

    def __init__(
        self,
        loop: TeleopLoop,
        robot: SimRobot,
        observers: Sequence[Observer] = (),
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Put the parts together.

        Args:
            loop: The teleop loop; its port is the robot.
            robot: The robot.
            observers: Called after every tick, in this order.
            clock: Monotonic time [s]; the loop's own.
            sleep: Waits for a time [s].
        """
        self._loop = loop
        self._robot = robot
        self._observers = observers
        self._clock = clock
        self._sleep = sleep

    def run(
        self,
        duration: float | None,
        keep_going: Callable[[], bool] = lambda: True,
        announce: Callable[[], None] = lambda: None,
    ) -> Pace:
        """Run until the time is up, `keep_going` says no, or Ctrl-C.

        Args:
            duration: Simulated time to run [s]; None runs on.
            keep_going: Asked before every tick.
            announce: Called when Ctrl-C ends the run and no longer the program.

        Returns:
            How it kept time.
        """
        limit = None if duration is None else round(duration / CONTROL_PERIOD)
        ticks = late = moved = 0
        busy = 0.0
        begin = end = due = self._clock()
        try:
            announce()
            begin = end = due = self._clock()
            while (limit is None or ticks < limit) and keep_going():
                self._wait_until(due)
                tick_begin = self._clock()
                if tick_begin - due > MAX_BACKLOG:
                    due, moved = tick_begin, moved + 1
                lateness = max(tick_begin - due, 0.0)
                report = self._loop.tick()
                self._robot.advance()
                end = self._clock()
                busy += end - tick_begin
                due += CONTROL_PERIOD
                late += end > due
                tick = Tick(
                    index=ticks,
                    sim_time=self._robot.time,
                    report=report,
                    qpos=self._robot.data.qpos.copy(),
                    wrists=self._robot.wrists(),
                    lateness=lateness,
                    busy=end - tick_begin,
                )
                ticks += 1
                for observer in self._observers:
                    observer.observe(tick)
        except KeyboardInterrupt:
            pass  # Ctrl-C is the ordinary end of a run without a duration; what was measured is still reported.
        return Pace(ticks, ticks * CONTROL_PERIOD, end - begin, busy, late, moved)

    def _wait_until(self, due: float) -> None:
        pause = due - self._clock()
        if pause > 0.0:
            self._sleep(pause)
