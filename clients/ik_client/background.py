"""One blocking call in a thread of its own, so that a control loop can stop waiting for it.

For calls of the operating system or of a library that take no timeout: a look-up of a host name, opening or closing a
Zenoh session. The thread is a daemon: a call that never returns does not keep the process from exiting. One that is
about to return does for a moment, because native code that returns into a dying interpreter aborts the process.
"""

import atexit
import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

_EXIT_SECONDS = 1.0
"""How long the calls under way may keep the process from exiting."""

_threads: set[threading.Thread] = set()


class Background(Generic[T]):
    """A call under way."""

    def __init__(self, call: Callable[[], T]) -> None:
        """Start it.

        Args:
            call: Runs in the thread.
        """
        self._call = call
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._discard: Callable[[T], None] | None = None
        self._value: T | None = None
        self._error: BaseException | None = None
        thread = threading.Thread(target=self._run, daemon=True)
        _threads.add(thread)
        thread.start()

    def wait(self, timeout: float) -> bool:
        """Wait for its end.

        Args:
            timeout: How long at most [s].

        Returns:
            Whether it has ended.
        """
        return self._done.wait(max(0.0, timeout))

    def result(self) -> T:
        """What the call returned, or raise what it raised. Only after its end."""
        if self._error is not None:
            raise self._error
        return self._value  # ty: ignore[invalid-explicit-return]  # the call has returned it, None included

    def abandon(self, discard: Callable[[T], None]) -> None:
        """Give it up: its result, should there be one some day, goes to `discard`, in its thread."""
        with self._lock:
            self._discard = discard
            ended = self._done.is_set()
        if ended and self._error is None:
            discard(self.result())

    def _run(self) -> None:
        try:
            self._value = self._call()
        except BaseException as error:
            self._error = error
        with self._lock:
            discard = self._discard
            self._done.set()
        try:
            if discard is not None and self._error is None:
                discard(self.result())
        finally:
            _threads.discard(threading.current_thread())


@atexit.register
def _wait_for_threads() -> None:
    end = time.monotonic() + _EXIT_SECONDS
    for thread in list(_threads):
        thread.join(max(0.0, end - time.monotonic()))
