"""One thread for work that takes long, so that threads which answer many clients never wait for it.

Few jobs may wait for their turn. One more is refused at once, and its client can decide what to do, instead of being
answered long after it has stopped listening. A job that waits may be superseded by whoever no longer wants it done; it
is answered nevertheless, at once.
"""

import threading
from collections import deque
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass

WAITING = 16
"""Jobs that may wait for their turn, besides the one being done."""

Job = Callable[[], bytes]


class Busy(RuntimeError):
    """As many jobs wait as may.

    Attributes:
        waiting: How many that is.
    """

    def __init__(self, waiting: int) -> None:
        """Say how many wait."""
        super().__init__(f"{waiting} long requests are waiting already; retry later")
        self.waiting = waiting


@dataclass(frozen=True, slots=True)
class Stream:
    """What makes a job one that may be superseded.

    Attributes:
        key: The same for all jobs of which only the newest matters.
        superseded: Makes the result of one that is not done because of a newer one.
    """

    key: Hashable
    superseded: Job


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A job that waits."""

    job: Job
    result: Future[bytes]
    stream: Stream | None


class Worker:
    """Does one job after the other, in the order in which they come.

    Its thread starts with the first job, and does not keep the process from ending.
    """

    def __init__(self, waiting: int = WAITING) -> None:
        """Start without jobs.

        Args:
            waiting: Jobs that may wait for their turn.
        """
        self._waiting = waiting
        self._jobs: deque[_Entry] = deque()
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._stopped = False

    def submit(self, job: Job, stream: Stream | None = None) -> Future[bytes]:
        """Take a job.

        Args:
            job: What to do.
            stream: What it belongs to; None where nothing supersedes it.

        Returns:
            Its result to come; callbacks run in the worker's thread. A job that is cancelled before its turn is
            forgotten and leaves its place to another.

        Raises:
            Busy: Too many wait already, or the worker has been stopped.
        """
        result: Future[bytes] = Future()
        with self._changed:
            if self._stopped or len(self._jobs) >= self._waiting:
                raise Busy(len(self._jobs))
            self._jobs.append(_Entry(job, result, stream))
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="worker", daemon=True)
                self._thread.start()
            self._changed.notify()
        result.add_done_callback(self._forget)
        return result

    def supersede(self, key: Hashable) -> None:
        """Answer the jobs of a stream that wait, instead of doing them; their callbacks run in the caller's thread.

        Args:
            key: The key of the stream.
        """
        if not self._jobs:
            return
        with self._changed:
            old = [entry for entry in self._jobs if entry.stream is not None and entry.stream.key == key]
            self._jobs = deque(entry for entry in self._jobs if entry not in old)
        for entry in old:
            assert entry.stream is not None
            if entry.result.set_running_or_notify_cancel():
                entry.result.set_result(entry.stream.superseded())

    def stop(self, timeout_s: float) -> bool:
        """Cancel what waits, and end after the job that is being done.

        Args:
            timeout_s: Longest time to wait for that job [s].

        Returns:
            Whether it was done in time.
        """
        with self._changed:
            self._stopped = True
            waiting = [entry.result for entry in self._jobs]
            self._changed.notify()
        for result in waiting:
            result.cancel()
        if self._thread is not None:
            self._thread.join(timeout_s)
        return self._thread is None or not self._thread.is_alive()

    def _forget(self, result: Future[bytes]) -> None:
        with self._changed:
            self._jobs = deque(entry for entry in self._jobs if entry.result is not result)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._jobs or self._stopped)
                if self._stopped:
                    return
                entry = self._jobs.popleft()
            if not entry.result.set_running_or_notify_cancel():
                continue
            try:
                entry.result.set_result(entry.job())
            except Exception as error:
                entry.result.set_exception(error)
