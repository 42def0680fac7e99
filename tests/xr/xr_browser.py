"""A browser's part in the tests: runs until its sockets are closed."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

import aiohttp

LIMIT = 20.0


def browse(work: Callable[[aiohttp.ClientSession], Coroutine[Any, Any, Any]]) -> Any:
    """Run a browser's part, within a limit; gives what it returns."""

    async def run() -> Any:
        async with aiohttp.ClientSession() as http:
            result = await asyncio.wait_for(work(http), LIMIT)
        # TLS says goodbye after the session has ended: wait until the loop watches nothing but its own pipe.
        watched: Any = asyncio.get_running_loop()
        await until(lambda: len(watched._selector.get_map()) <= 1)
        return result

    return asyncio.run(run())


async def until(condition: Callable[[], Any]) -> None:
    """Wait for a condition, within a limit."""
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end
        await asyncio.sleep(0.002)
