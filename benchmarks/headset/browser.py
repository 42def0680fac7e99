"""A page of `ik-xr --emulate` in Chromium without a screen, and hands that move in it."""

import shutil
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Error, Page, ViewportSize, sync_playwright

LIMIT_S, _POLL_S = 60.0, 0.05
LIFT = (0.0, 0.25, -0.2)
"""Where the hands go before they circle: to the right, up, back [m]."""

OPEN_POSES, GRIPS, GRIP_LIMIT_S = 20, 5, 3.0
"""For how many poses hands are open before they grip; how often they do, and how long each time arms may take [s]."""

_FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--disable-background-networking", "--disable-sync")
_SIZE = ViewportSize(width=640, height=320)

_FOLLOWS = "['left', 'right'].every((side) => ikxr.hud[side].state === 'active')"
_STALL = """() => {
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (data) {
    if (!(globalThis.videoStalls && typeof data === "string" && data.includes('"shown"'))) {
      send.call(this, data);
    }
  };
}"""

_MOVE = """async ([seconds, lift, wide]) => {
  const sides = ["left", "right"];
  const from = sides.map((side) => xrOperator.pose(side));
  const smooth = (x) => { const s = Math.min(Math.max(x, 0), 1); return s * s * s * (10 + s * (6 * s - 15)); };
  const begin = performance.now();
  const shown = ikxr.stats.shown;
  const end = await new Promise((done) => {
    const move = () => {
      const t = (performance.now() - begin) / 1e3;
      const far = smooth(wide > 0 ? t / 2 : t / seconds);
      const radius = wide * smooth(t - 2) * smooth(seconds - t);
      const angle = 2 * Math.PI * 0.4 * t;
      const circle = [0, radius * Math.sin(angle), radius * (Math.cos(angle) - 1)];
      sides.forEach((side, k) => {
        const place = from[k].position.map((x, n) => x + circle[n] + far * lift[n]);
        xrOperator.place(side, place, from[k].orientation);
      });
      if (t < seconds) requestAnimationFrame(move); else done(performance.now());
    };
    move();
  });
  return { begin, end, shown: ikxr.stats.shown - shown };
}"""


class Lost(Exception):
    """The run cannot go on; one line that says why."""


@dataclass(frozen=True, slots=True)
class Moved:
    """What the page says of hands that have moved.

    Attributes:
        begin: When they began, by the page's clock [ms].
        end: When they stopped [ms].
        shown: Images drawn in between.
    """

    begin: float
    end: float
    shown: int


class Headset:
    """An emulated headset that somebody wears."""

    def __init__(self, page: Page) -> None:
        self._page = page

    def enter(self, url: str, *, video: bool) -> None:
        """Open the page and enter VR, with the robot ready and, where it is wanted, a picture before the eyes."""
        try:
            self._page.goto(url)
        except Error as error:
            raise Lost(f"the page does not open: {error.message.splitlines()[0]}") from None
        self._until("document.querySelector('#enter-vr')?.disabled === false", "the page does not let anybody in")
        self._page.evaluate(_STALL)
        self._page.click("#enter-vr")
        self._until("ikxr.session !== null && ikxr.stats.frames > 0", "the session does not begin")
        self._page.keyboard.press("?")  # hides the list of keys, which is before the picture
        if video:
            self._until("ikxr.stats.shown > 0", "no picture is shown")
        self._until("ikxr.hud !== null && !ikxr.hud.note.startsWith('robot')", "the robot is not ready")

    def grip(self) -> None:
        """Grip with both hands, which have been seen open, until both arms follow; more than once on a busy machine."""
        for _ in range(GRIPS):
            sent = self._page.evaluate("ikxr.stats.sent")
            self._until(f"ikxr.stats.sent > {sent + OPEN_POSES}", "the page sends no poses")
            self._hold(True)
            end = time.monotonic() + GRIP_LIMIT_S
            while time.monotonic() < end:
                if self.follows:
                    return
                time.sleep(_POLL_S)
            self.let_go()
        raise Lost(f"no arm follows: {self._page.evaluate('ikxr.hud')}")

    @property
    def follows(self) -> bool:
        """Whether both arms follow."""
        return self._page.evaluate(_FOLLOWS)

    def let_go(self) -> None:
        """Let go, and wait until no arm follows."""
        self._hold(False)
        self._until("['left', 'right'].every((side) => ikxr.hud[side].state === 'disarmed')", "an arm is not let go")

    def _hold(self, held: bool) -> None:
        self._page.evaluate("(held) => ['left', 'right'].forEach((side) => xrOperator.grip(side, held))", held)

    @property
    def changes(self) -> int:
        """How often an arm has changed its state."""
        return self._page.evaluate("ikxr.hud.left.changes + ikxr.hud.right.changes")

    def stall_video(self) -> None:
        """Say of no image any more that it was shown."""
        self._page.evaluate("globalThis.videoStalls = true; 0")

    def circle(self, seconds: float) -> Moved:
        """Lift both hands, move them in circles of 8 cm, and stop them where they were lifted to."""
        return self._move(seconds, LIFT, 0.04)

    def step(self, seconds: float, way: tuple[float, float, float]) -> Moved:
        """Move both hands on a straight way, from rest to rest: to the right, up, back [m]."""
        return self._move(seconds, way, 0.0)

    def _move(self, seconds: float, way: tuple[float, float, float], radius: float) -> Moved:
        said: dict[str, Any] = self._page.evaluate(_MOVE, [seconds, way, radius])
        return Moved(**said)

    def screenshot(self, path: Path) -> None:
        """Save what both eyes see."""
        self._page.screenshot(path=path)

    def _until(self, expression: str, otherwise: str) -> None:
        # The page's own rules forbid Playwright to wait in it for an expression.
        end = time.monotonic() + LIMIT_S
        while not self._page.evaluate(expression):
            if time.monotonic() > end:
                said = self._page.evaluate("[document.querySelector('#fault')?.innerText, globalThis.ikxr?.hud]")
                raise Lost(f"{otherwise}: {said}")
            time.sleep(_POLL_S)


@contextmanager
def chromium() -> Generator[Browser]:
    """Run the browser.

    Raises:
        Lost: There is none.
    """
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        raise Lost("no Chromium: on Debian or Ubuntu, apt install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(_FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def headset(browser: Browser) -> Generator[Headset]:
    """A headset in a fresh tab."""
    page = browser.new_page(viewport=_SIZE)
    try:
        yield Headset(page)
    finally:
        page.close()
