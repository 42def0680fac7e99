"""The real server with the real page, and what arrives from a browser that has opened it."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from chromium import Tab

from xr_client.door import Door
from xr_client.packets import PosePacket, decode_packet
from xr_client.pages import WEB, Pages
from xr_client.pose_socket import PoseSocket
from xr_client.server import Place, XrServer
from xr_client.tracker import Arrival, Tracker
from xr_client.video_socket import VideoSocket

LIMIT = 30.0
TOKEN = "0123456789abcdef"


def wait_for(condition: Callable[[], Any], what: str) -> Any:
    """Wait until a condition gives something true, within a limit; gives that."""
    end = time.monotonic() + LIMIT
    while not (found := condition()):
        assert time.monotonic() < end, f"never: {what}"
        time.sleep(0.002)
    return found


class PageServer:
    """A server on the loopback address.

    Attributes:
        tracker: Gets the poses.
        packets: All that counted, and when they arrived [s].
        url: Of the page, without a token.
    """

    def __init__(self, *, emulator: Path | None = None, folder: Path = WEB, ca_der: bytes | None = None) -> None:
        door = Door(TOKEN, [])
        self.tracker = Tracker()
        self.packets: list[tuple[float, PosePacket]] = []
        self.pose = PoseSocket(
            door, self.tracker, record=lambda data, now: self.packets.append((now, decode_packet(data)))
        )
        self.video = VideoSocket(door)
        self._server = XrServer(Pages(folder, ca_der, emulator), self.pose, self.video)

    def start(self, port: int = 0, *others: Place) -> list[int]:
        """Listen; gives the ports, the one without TLS first."""
        ports = self._server.start(Place("127.0.0.1", port), *others)
        self.url = f"http://127.0.0.1:{ports[0]}"
        return ports

    def stop(self) -> None:
        self._server.stop()

    def arrival(self, condition: Callable[[Arrival], Any], what: str) -> Arrival:
        """Wait for a packet."""

        def found() -> Arrival | None:
            latest = self.tracker.latest
            return latest if latest is not None and condition(latest) else None

        return wait_for(found, what)

    def after(self, tab: Tab, script: str = "", argument: Any = None) -> Arrival:
        """Have the page run statements of an `argument`; gives the first packet whose poses are from after that."""
        now = tab.js(f"(argument) => {{ {script}; return performance.now(); }}", argument)
        return self.arrival(lambda arrival: arrival.packet.capture_ms > now, f"a packet after {script}")


SETTLED = """
  xrDevice.primaryInputMode = "hand";
  xrDevice.updateVisibilityState("visible");
  xrDevice.position.set(0, 1.6, 0);
  xrDevice.quaternion.set(0, 0, 0, 1);
  for (const [side, x] of [["left", -0.2], ["right", 0.2]]) {
    xrOperator.setSeen(side, true);
    xrOperator.grip(side, false);
    xrOperator.place(side, [x, 1.25, -0.4], [0, 0, 0, 1]);
  }
"""


def settle(server: PageServer, tab: Tab) -> None:
    """Bring a headset that was used back to where it began."""
    if not tab.js("Boolean(xrDevice.activeSession)"):
        put_on(tab, server)
    tab.key("Digit3")
    tab.js(f"{SETTLED}; 0")

    def settled(arrival: Arrival) -> bool:
        pinches = [hand.pinch for hand in arrival.packet.hands if hand.pose is not None]
        return arrival.packet.visible and len(pinches) == 2 and all(pinch and pinch > 0.08 for pinch in pinches)

    server.arrival(settled, "two open hands")
    server.after(tab)


def enter(tab: Tab, server: PageServer, path: str = "/emulate", token: str = TOKEN) -> Arrival:
    """Open the page and put the headset on, by a click; gives the first packet with both hands."""
    tab.goto(f"{server.url}{path}#{token}")
    return put_on(tab, server)


def put_on(tab: Tab, server: PageServer) -> Arrival:
    """Click on the button that begins a session."""
    tab.until("document.querySelector('#enter-vr')?.disabled === false")
    tab.click("#enter-vr")
    return server.after(tab)
