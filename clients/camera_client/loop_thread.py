"""The teleop loop's own thread: a tick each period of the robot, whatever displays and devices do."""

import collections
import threading
from collections.abc import Callable

from ik_client.pacer import Pacer

REST_TICKS = 50
"""Ticks after the last frame in which the arms come to rest."""


class LoopThread:
    """Ticks until it is told to end, or has rested long enough after the source has.

    Attributes:
        lines: What is to be told to the operator, oldest first; may be taken away from the left.
    """

    def __init__(
        self,
        tick: Callable[[], list[str]],
        end: Callable[[Callable[[], None]], None],
        pacer: Pacer,
        paced: Callable[[Pacer], None],
        finished: Callable[[], bool],
    ) -> None:
        """Prepare; `start` starts it.

        Args:
            tick: Does a tick, and gives what has changed, a line each.
            end: Disarms, and does the last ticks with what it is given.
            pacer: Keeps the schedule.
            paced: Called before each tick.
            finished: Whether no frames will come any more.
        """
        self.lines: collections.deque[str] = collections.deque()
        self._tick, self._end_with, self._pacer, self._paced, self._finished = tick, end, pacer, paced, finished
        self._end = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="ik-camera loop", daemon=True)

    def start(self) -> None:
        """Begin to tick."""
        self._thread.start()

    @property
    def alive(self) -> bool:
        """Whether it ticks."""
        return self._thread.is_alive()

    def close(self) -> None:
        """Disarm, bring the arms to rest, end.

        Raises:
            Exception: What ended it before.
        """
        self._end.set()
        if self._thread.ident is not None:
            self._thread.join()
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _run(self) -> None:
        rest = REST_TICKS
        try:
            while rest and not self._end.is_set():
                self._pacer.wait()
                self._paced(self._pacer)
                self._tell()
                rest -= self._finished()
            self._end_with(self._tell)
        except BaseException as error:  # told by `close`, in the main thread
            self._error = error

    def _tell(self) -> None:
        self.lines.extend(self._tick())
