"""A real browser for tests of the page: Chromium without a screen, in a thread of its own, with plain blocking calls.

Playwright's own blocking calls leave an event loop running in their thread, where no other test could start one.
"""

import asyncio
import shutil
import threading
from collections.abc import Coroutine, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, Self

from playwright.async_api import Browser, ConsoleMessage, Error, Page, Playwright, async_playwright

LIMIT = 60.0
"""How long a call may take on a busy machine [s]."""

_FLAGS = (
    "--no-sandbox",  # root in a container has none
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def executable() -> str | None:
    """Path of Chromium; None where it is not installed."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Tab:
    """A page in a browser context of its own.

    Attributes:
        requests: URLs the page asked for, WebSockets included.
        console: Warnings, errors and uncaught exceptions, one line each.
    """

    def __init__(self, chromium: "Chromium", page: Page) -> None:
        self.requests: list[str] = []
        self.console: list[str] = []
        self._chromium = chromium
        self._page = page
        page.set_default_timeout(LIMIT * 1e3)
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("websocket", lambda socket: self.requests.append(socket.url))
        page.on("console", self._on_console)
        page.on("pageerror", lambda error: self.console.append(f"uncaught: {error}"))

    def before(self, script: str) -> None:
        """Run a script in every page that is opened from now on, before the page's own."""
        self._chromium.run(self._page.add_init_script(script))

    def goto(self, url: str) -> None:
        """Open a URL."""
        self._chromium.run(self._page.goto(url))

    def reload(self) -> None:
        """Load the page anew."""
        self._chromium.run(self._page.reload())

    def js(self, expression: str, argument: Any = None) -> Any:
        """Evaluate an expression, or a function of one argument, and wait for a promise it gives."""
        return self._chromium.run(self._page.evaluate(expression, argument))

    def until(self, expression: str, argument: Any = None) -> None:
        """Wait until an expression, or a function of one argument, gives something true."""
        self._chromium.run(self._until(expression, argument))

    def click(self, selector: str) -> None:
        """Click as a person does."""
        self._chromium.run(self._page.click(selector))

    def key(self, code: str) -> None:
        """Press a key and let go."""
        self._chromium.run(self._page.keyboard.press(code))

    @contextmanager
    def holding(self, code: str) -> Generator[None]:
        """Hold a key for as long as the block lasts."""
        self._chromium.run(self._page.keyboard.down(code))
        yield
        self._chromium.run(self._page.keyboard.up(code))

    def drag(self, start: tuple[int, int], end: tuple[int, int], button: Literal["left", "right"] = "left") -> None:
        """Move the mouse with a button held [pixel]."""
        mouse = self._page.mouse
        self._chromium.run(mouse.move(*start))
        self._chromium.run(mouse.down(button=button))
        self._chromium.run(mouse.move(*end, steps=4))
        self._chromium.run(mouse.up(button=button))

    def roll(self, amount: int) -> None:
        """Turn the mouse's wheel towards the person."""
        self._chromium.run(self._page.mouse.wheel(0, amount))

    def text(self, selector: str) -> str:
        """The text a person sees there."""
        return self._chromium.run(self._page.inner_text(selector))

    def screenshot(self, path: Path) -> None:
        """Save what the page shows."""
        self._chromium.run(self._page.screenshot(path=path))

    def close(self) -> None:
        """Close the page and its context."""
        self._chromium.run(self._page.context.close())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    async def _until(self, expression: str, argument: Any) -> None:
        # Playwright's own way of waiting evaluates text inside the page, which the page's rules forbid.
        end = asyncio.get_running_loop().time() + LIMIT
        while not await self._evaluate(expression, argument):
            in_time = asyncio.get_running_loop().time() < end
            assert in_time, f"never: {expression}; the console says {self.console[-5:]}"
            await asyncio.sleep(0.01)

    async def _evaluate(self, expression: str, argument: Any) -> Any:
        try:
            return await self._page.evaluate(expression, argument)
        except Error as error:
            if "context was destroyed" not in str(error):
                raise
            return None  # the page is just being loaded anew

    def _on_console(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            self.console.append(f"{message.type}: {message.text}")


class Chromium:
    """A browser; opens tabs."""

    def __init__(self, *flags: str, env: Mapping[str, str] | None = None) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="chromium", daemon=True)
        self._thread.start()
        self._playwright: Playwright | None = None
        self._browser: Browser | None = None
        try:
            self.run(self._launch([*_FLAGS, *flags], env))
        except BaseException:
            self.close()
            raise

    def tab(self, width: int = 640, height: int = 320, **context: Any) -> Tab:
        """Open an empty tab; further arguments are those of a Playwright context."""
        return self.run(self._tab(viewport={"width": width, "height": height}, **context))

    def run(self, work: Coroutine[Any, Any, Any]) -> Any:
        """Wait for work of Playwright."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(LIMIT + 5.0)

    def close(self) -> None:
        """End the browser."""
        self.run(self._end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _launch(self, flags: list[str], env: Mapping[str, str] | None) -> None:
        self._playwright = await async_playwright().start()
        self._browser = await self._playwright.chromium.launch(
            executable_path=executable(), args=flags, env={**env} if env else None
        )

    async def _tab(self, **context: Any) -> Tab:
        # Here, because Playwright binds what listens to a page to the running event loop.
        assert self._browser is not None
        return Tab(self, await self._browser.new_page(**context))

    async def _end(self) -> None:
        if self._browser is not None:
            await self._browser.close()
        if self._playwright is not None:
            await self._playwright.stop()
