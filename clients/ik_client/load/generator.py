"""One client's stream of requests: when each is due, when it is sent, what comes of it.

- Open loop: requests are due at a constant rate, fixed beforehand, whether or not the ones before are answered. One
  that could not be sent in time is sent as soon as possible, and its latency counts from when it was due.
- Closed loop: a request is due one period after the one before was sent, or when that was answered, whichever is
  later. Such a client waits with a freezing service and so measures the freeze once: it is there to compare with.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from ik_client.errors import IKError, Refused, ServiceTimeout
from ik_client.load.outcomes import Outcomes
from ik_client.load.workloads import Workload
from ik_client.types import Solver
from ik_proto import Collision, Mode

_LONGEST_SLEEP = 0.1
"""How often a waiting client looks whether it should stop [s]."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """When a client's requests are due.

    Attributes:
        begin: When the first one is [s].
        measure: From when on they count; before it the service warms up [s].
        end: When no more are due [s].
        period: Time from one to the next [s]; 0 in a closed loop sends the next with the answer.
        closed: Whether a request waits for the answer to the one before.
        grace: How long after the end requests that were due may still be sent [s].
        first: Index of the workload's request to begin with.
    """

    begin: float
    measure: float
    end: float
    period: float
    closed: bool = False
    grace: float = 1.0
    first: int = 0


class Generator:
    """Runs one client's schedule.

    Attributes:
        outcomes: What came of the requests so far.
    """

    def __init__(
        self,
        ik: Solver,
        workload: Workload,
        schedule: Schedule,
        *,
        good_within: float,
        mode: Mode | None = None,
        collision: Collision | None = None,
        stopped: Callable[[], bool] = lambda: False,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Prepare; nothing is sent yet.

        Args:
            ik: The client to send with.
            workload: What to send.
            schedule: When.
            good_within: Latency up to which an answer counts as good [s].
            mode: How to solve; None for the protocol's default.
            collision: What to do about self-collision; None for the service's default.
            stopped: Says when to end early.
            clock: Monotonic time [s].
            sleep: Waits for a number of seconds.
        """
        self.outcomes = Outcomes()
        self._ik = ik
        self._workload = workload
        self._schedule = schedule
        self._good_within = good_within
        self._mode: Mode | None = mode
        self._collision: Collision | None = collision
        self._stopped = stopped
        self._clock = clock
        self._sleep = sleep
        self._q = None

    def run(self) -> Outcomes:
        """Send everything that is due.

        Returns:
            What came of it.
        """
        schedule = self._schedule
        due, free, k = schedule.begin, schedule.begin, 0
        while due < schedule.end and self._wait_until(due):
            sent = self._clock()
            if sent > schedule.end + schedule.grace:
                self._record_unsent(due, sent)
            else:
                self._request(schedule.first + k, due, sent, free)
                free = self._clock()
            k += 1
            due = max(sent + schedule.period, free) if schedule.closed else schedule.begin + k * schedule.period
        return self.outcomes

    def _wait_until(self, due: float) -> bool:
        """Wait; false where the run was stopped meanwhile."""
        while not self._stopped():
            left = due - self._clock()
            if left <= 0.0:
                return True
            self._sleep(min(left, _LONGEST_SLEEP))
        return False

    def _request(self, k: int, due: float, sent: float, free: float) -> None:
        """Send the k-th request and record what comes of it."""
        workload, frame = self._workload, self._workload.frame(k)
        q = self._q if workload.chained and self._q is not None else workload.q[frame]
        error, reply = None, None
        try:
            reply = self._ik.solve(
                workload.left[frame],
                workload.right[frame],
                q,
                0.0 * q,
                mode=self._mode,
                collision=self._collision,
            )
        except IKError as raised:
            error = raised
        done = self._clock()
        if reply is not None and reply.success:
            self._q = reply.sol_q
        if due < self._schedule.measure:
            return
        outcomes = self.outcomes
        outcomes.lateness.record(sent - max(due, free))
        if error is not None and not isinstance(error, ServiceTimeout):
            outcomes.errors[_kind(error)] += 1
            return
        outcomes.latency.record(done - due)
        outcomes.round_trip.record(done - sent)
        if reply is None:
            outcomes.timeouts += 1
            return
        outcomes.statuses[reply.status.value] += 1
        outcomes.solve.record(reply.solve_us * 1e-6)
        outcomes.good += reply.success and done - due <= self._good_within

    def _record_unsent(self, due: float, now: float) -> None:
        if due >= self._schedule.measure:
            self.outcomes.unsent += 1
            self.outcomes.latency.record(now - due)


def _kind(error: IKError) -> str:
    return str(error.status) if isinstance(error, Refused) else type(error).__name__
