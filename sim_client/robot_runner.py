"""Runs a simulated robot alone, in step with the clock: the process that has the motors and nothing else.

- A control tick is: take what commands have come, guard, physics, send the state. Ticks are due on a fixed schedule;
  after a gap longer than `MAX_BACKLOG` it is moved, and the robot is not rushed through the missed time.
- When it is asked to stop it gives the arms back: it goes on until the weight is 0, for a bounded time.
- Nothing here raises for what a source does.
"""

import time
from collections.abc import Callable

from ik_client.robot_end import EndState, LinkServer, Reception
from ik_client.types import RobotState
from ik_proto.robot_link import LinkState
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.robot_report import RobotRecord

MAX_BACKLOG = 0.5
"""How far behind schedule a run tries to catch up [s]."""

RELEASE_MARGIN = 1.0
"""How much longer than the ramp giving back may take [s]."""


class RobotRunner:
    """Runs a robot and its link together.

    Attributes:
        record: What the run showed so far.
    """

    def __init__(
        self,
        robot: SimRobot,
        link: LinkServer,
        say: Callable[[str], None],
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        moved: Callable[[float], None] = lambda _now: None,
    ) -> None:
        """Put the parts together.

        Args:
            robot: The robot.
            link: Where its commands come from; it has been started.
            say: Told each change of state in a line.
            clock: Monotonic time, the same as the robot's and the link's [s].
            sleep: Waits for a time [s].
            moved: Told the time [s] after the physics of every tick, also while the arms are given back.
        """
        self.record = RobotRecord()
        self._robot = robot
        self._link = link
        self._say = say
        self._clock = clock
        self._sleep = sleep
        self._moved = moved
        self._said = (robot.guard.state, "")
        self._due = clock()

    def run(
        self,
        keep_going: Callable[[], bool],
        duration: float | None = None,
        shown: Callable[[], None] = lambda: None,
    ) -> None:
        """Run until the time is up or `keep_going` says no.

        Args:
            keep_going: Asked before every tick.
            duration: Simulated time to run [s]; None runs on.
            shown: Called in the pause after every tick.
        """
        end = None if duration is None else self._robot.time + duration - 0.5 * CONTROL_PERIOD
        self._due = self._clock()
        while keep_going() and (end is None or self._robot.time < end):
            self.tick()
            shown()

    def release(self, ramp: float) -> bool:
        """Give the arms back and run until that is done.

        Args:
            ramp: How long the weight takes from 1 to 0 [s].

        Returns:
            Whether the weight is 0.
        """
        self._robot.release()
        end = self._robot.time + ramp + RELEASE_MARGIN
        while not self._robot.released and self._robot.time < end:
            self.tick()
        self._publish()
        return self._robot.released

    def tick(self) -> None:
        """Run one control tick when it is due."""
        pause = self._due - self._clock()
        if pause > 0.0:
            self._sleep(pause)
        elif pause < -MAX_BACKLOG:
            self._due = self._clock()
        self._due += CONTROL_PERIOD
        for arrival in self._link.take():
            reception = self._robot.offer(arrival.command, arrival.time)
            arrival.connection.busy = reception is Reception.BUSY
        self._robot.advance()
        self._moved(self._clock())
        self._publish()
        self.record.observe(self._robot)
        self._announce()

    def _publish(self) -> None:
        guard = self._robot.guard

        def message(state: RobotState) -> LinkState:
            return LinkState(
                q=state.q,
                dq=state.dq,
                time=state.time,
                waist=state.waist,
                q_set=state.q_set,
                tau_set=state.tau_set,
                ready=state.ready,
                following=state.following,
                note=state.note,
                weight=guard.weight,
                state=guard.state.value,
            )

        self._link.publish(message(self._robot.read()), message(self._robot.read_for(busy=True)))

    def _announce(self) -> None:
        state = self._robot.guard.state
        note = self._robot.read().note if state in (EndState.READY, EndState.HOLDING) else ""
        if (state, note) != self._said:
            self._said = (state, note)
            self._say(f"{self._robot.time:7.2f} s  {state}{f': {note}' if note else ''}")
