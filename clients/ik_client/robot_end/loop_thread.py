"""An event loop in a thread of its own, for the ends of the link: their callers keep time and never wait for it."""

import asyncio
import threading
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")

_STOP_LIMIT = 2.0

_CLOSING_TURNS = 8
"""Turns of the loop in which a transport that was closed gives its socket back; with TLS it takes more than one."""


class LoopThread:
    """The thread; a daemon, so that it never keeps a process from exiting."""

    def __init__(self, name: str) -> None:
        """Start it.

        Args:
            name: Name of the thread.
        """
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name=name, daemon=True)
        self._thread.start()

    @property
    def closed(self) -> bool:
        """Whether it has ended."""
        return self._loop.is_closed()

    def soon(self, call: Callable[..., object], *arguments: object) -> None:
        """Have something called in the loop, without waiting for it; nothing happens once the loop is closed."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(call, *arguments)

    def run(self, work: Coroutine[Any, Any, T], timeout: float | None = None) -> T:
        """Run a coroutine in the loop and wait for it.

        Args:
            work: The coroutine.
            timeout: How long at most [s]; None for as long as it takes.

        Raises:
            TimeoutError: It took longer.
            Exception: What it raised.
        """
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(timeout)

    def close(self) -> None:
        """Cancel what is left and end the thread."""
        if not self._loop.is_closed():
            self.run(_cancel_others(), _STOP_LIMIT)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_STOP_LIMIT)
            self._loop.close()


async def _cancel_others() -> None:
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)
    for _ in range(_CLOSING_TURNS):
        await asyncio.sleep(0)
