"""The page's drawing without a headset: a rig in a browser, and where something must be seen.

What is expected is computed here from the poses; the page's own matrices have no part in it.
"""

import base64
import math
from typing import Any

import numpy as np
from chromium import Tab
from xr_page import TOKEN, PageServer

EYE = 320
"""Width and height of what an eye sees [px]."""
SEES = math.radians(100.0)
"""Field of view of an eye, both ways."""
STANDING = (0.0, 1.6, 0.0)
AHEAD = (0.0, 1.6, -2.0)
"""The middle of the screen for a head that stands and looks ahead."""
RED, BLUE, WHITE = "rgb(200 0 0)", "rgb(0 0 200)", "rgb(200 200 200)"
FINE = {"open": True, "reason": "", "fps": 30.0, "shownMs": 10.0}
LINKED = {"open": True, "reason": ""}


class Rig:
    """A browser's tab with `picture_rig.js`: a canvas with an eye on each half, and a clock that tests set."""

    def __init__(self, tab: Tab, host: PageServer) -> None:
        self.tab = tab
        self.host = host

    def open(self) -> None:
        """Begin anew, with a head that stands and looks ahead."""
        self.tab.goto(self.host.url)
        self.until("globalThis.rig !== undefined")
        self.look(room())

    def js(self, expression: str, argument: Any = None) -> Any:
        return self.tab.js(expression, argument)

    def until(self, expression: str) -> None:
        self.tab.until(expression)

    def connect(self, token: str = TOKEN) -> None:
        """Have images come from the server."""
        self.js("url => rig.connect(url)", f"{self.host.url.replace('http', 'ws')}/video?token={token}")

    def look(self, T_room_head: np.ndarray) -> None:
        """Put the head somewhere; both eyes are where it is."""
        place = {
            "head": {"position": T_room_head[:3, 3].tolist(), "orientation": _xyzw(T_room_head[:3, :3])},
            "projection": _projection().T.ravel().tolist(),
            "view": np.linalg.inv(T_room_head).T.ravel().tolist(),
        }
        self.js("place => rig.look(place)", place)

    def say(self, shown: Any = None, link: Any = LINKED, video: Any = FINE) -> None:
        """Tell the stage how things are."""
        self.js("state => rig.stage.hud(state)", {"hud": shown, "link": link, "video": video})

    def show(self, seq: int = 1, left: str = RED, right: str = BLUE, **options: Any) -> None:
        """Give the stage an image of one colour for each eye."""
        images = [seq, left, right, options]
        self.js("async ([seq, l, r, options]) => void (await rig.show(seq, l, r, options))", images)

    def draw(self, after_ms: float = 0.0) -> int | None:
        """Draw a frame, some time after the one before."""
        return self.js("ms => { rig.now += ms; return rig.draw(); }", after_ms)

    def pixel(self, point: Any, T_room_head: np.ndarray | None = None, eye: str = "left") -> list[int]:
        """Colour and opacity of what is seen where a point of the room is."""
        where = seen_at(room() if T_room_head is None else T_room_head, point)
        assert in_view(where), "the test looks elsewhere"
        return self.js("([eye, x, y]) => rig.pixel(eye, x, y)", [eye, *where.tolist()])

    def picture(self, eye: str = "left") -> np.ndarray:
        """What an eye sees, shape (320, 320, 4)."""
        data = base64.b64decode(self.js("eye => rig.pixels(eye)", eye))
        return np.frombuffer(data, np.uint8).astype(int).reshape(EYE, EYE, 4)[::-1]


def room(position: Any = STANDING, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    """`T_room_head`: turned by yaw (left), then about its own axes by pitch (up) and roll [rad]."""
    T = np.eye(4)
    for angle, (i, j) in ((yaw, (2, 0)), (pitch, (1, 2)), (roll, (0, 1))):
        turn = np.eye(4)
        turn[[i, j, i, j], [i, j, j, i]] = (math.cos(angle), math.cos(angle), -math.sin(angle), math.sin(angle))
        T @= turn
    T[:3, 3] = position
    return T


def seen_at(T_room_head: np.ndarray, point: Any) -> np.ndarray:
    """Where a point of the room is seen, counted from the left and the top [px]."""
    x, y, _, w = _projection() @ np.linalg.inv(T_room_head) @ [*point, 1.0]
    return np.array([0.5 + 0.5 * x / w, 0.5 - 0.5 * y / w]) * EYE - 0.5


def in_view(where: np.ndarray) -> bool:
    """Whether an eye sees there."""
    return bool(((where > 0) & (where < EYE - 1)).all())


def arm(state: str = "active", **others: Any) -> dict[str, Any]:
    """What a HUD says of an arm."""
    fields = {"state": state, "reason": "", "position_error_mm": None, "rotation_error_deg": None}
    return fields | {"warning": "", "changes": 0} | others


def hud(left: Any = None, right: Any = None, note: str = "", **latency_ms: float | None) -> dict[str, Any]:
    """A HUD."""
    return {"left": left or arm(), "right": right or arm(), "note": note, "latency_ms": latency_ms}


def _projection() -> np.ndarray:
    focal, near, far = 1.0 / math.tan(0.5 * SEES), 0.05, 100.0
    a, b = (near + far) / (near - far), 2 * near * far / (near - far)
    return np.array([[focal, 0, 0, 0], [0, focal, 0, 0], [0, 0, a, b], [0, 0, -1, 0]])


def _xyzw(R: np.ndarray) -> list[float]:
    """The quaternion of a rotation: an eigenvector of Bar-Itzhack's matrix."""
    (a, b, c), (d, e, f), (g, h, i) = R
    K = [[a - e - i, b + d, c + g, h - f], [b + d, e - a - i, f + h, c - g], [c + g, f + h, i - a - e, d - b]]
    return np.linalg.eigh([*K, [h - f, c - g, d - b, a + e + i]])[1][:, -1].tolist()
