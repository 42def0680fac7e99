"""A panel of bars beside the arrows: how far each arm is from a singular posture, and its joints from their limits.

    manipulability    the mark is where a posture begins to count as singular; the bar is full at ten times that
    each joint        from the middle of its range to the left or right; at the end it is at its limit

Below stands what limits each arm, if anything does.
"""

import numpy as np
from PIL import Image as PilImage
from PIL import ImageDraw, ImageFont

from ik_proto.limits import SINGULAR_TWIST
from sim_client.motion_arrows import ASKED, MEASURED
from sim_client.motion_view import MotionView
from sim_client.offscreen import Image

SIZE = (420, 276)
"""Width and height [pixel]."""

FULL = 10.0
"""Multiple of `SINGULAR_TWIST` at which the bar of the manipulability is full."""

WELL, NEAR, THERE = (70, 180, 110), (240, 180, 60), (225, 70, 60)
"""Colours of bars: all is well; not much is left; nothing is left."""

SPEECH = {
    "speed": "largest joint speed",
    "acceleration": "largest acceleration",
    "joint": "joint limit",
    "bounds": "the box",
    "singularity": "singular posture",
    "collision": "the body",
}
"""Words for what limits an arm."""

PAPER = (25, 32, 42)
"""Colour of what is behind them."""

_INK, _DIM, _TROUGH = (235, 240, 245), (150, 160, 172), (52, 62, 76)
_NEAR_JOINT, _AT_JOINT = 0.9, 0.985
_NEAR_SINGULAR, _SINGULAR = 4.0, 1.0
_MARGIN, _ROW, _BAR, _COLUMN = 12, 24, 12, 205


def draw_panel(view: MotionView) -> Image:
    """Draw the panel of a motion."""
    canvas = PilImage.new("RGB", SIZE, PAPER)
    pen, font = ImageDraw.Draw(canvas), ImageFont.load_default(13)
    _legend(pen, font)
    for arm, side in enumerate(("left", "right")):
        x = _MARGIN + arm * _COLUMN
        pen.text((x, 8), side, font=font, fill=_INK)
        times = float(view.motion.manipulability[arm]) / SINGULAR_TWIST
        _row(pen, font, x, 1, "manipulability", min(times / FULL, 1.0), _colour(times, _NEAR_SINGULAR, _SINGULAR))
        mark = _bar_left(x) + _bar_width() / FULL
        pen.line((mark, _bar_top(1) - 2, mark, _bar_top(1) + _BAR + 2), fill=_INK)
        for k, (name, place) in enumerate(zip(view.joints[arm], view.places[arm], strict=True), start=2):
            colour = _colour(-abs(float(place)), -_NEAR_JOINT, -_AT_JOINT)
            _row(pen, font, x, k, _short(name, side), float(place), colour, centred=True)
        pen.text((x, SIZE[1] - 42), _limit(view, arm, side), font=font, fill=_INK)
    return np.asarray(canvas)


def _limit(view: MotionView, arm: int, side: str) -> str:
    what, joint = view.motion.limited_by[arm], view.motion.limiting_joint[arm]
    if not what:
        return "nothing limits"
    name = f"\n{_short(joint, side)}" if joint else ""
    return f"limited: {SPEECH.get(what, what)}{name}"


def _row(
    pen: ImageDraw.ImageDraw,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
    x: int,
    row: int,
    name: str,
    value: float,
    colour: tuple[int, int, int],
    centred: bool = False,
) -> None:
    left, top, width = _bar_left(x), _bar_top(row), _bar_width()
    pen.text((x, top - 3), name, font=font, fill=_DIM)
    pen.rectangle((left, top, left + width, top + _BAR), fill=_TROUGH)
    begin = left + width / 2 if centred else left
    end = begin + value * (width / 2 if centred else width)
    pen.rectangle((min(begin, end), top, max(begin, end), top + _BAR), fill=colour)


def _legend(pen: ImageDraw.ImageDraw, font: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> None:
    x = SIZE[0] - 150
    for name, colour in (("asked", ASKED), ("measured", MEASURED)):
        pen.rectangle((x, 12, x + 10, 22), fill=tuple(round(255 * part) for part in colour))
        pen.text((x + 15, 8), name, font=font, fill=_INK)
        x += 65


def _colour(value: float, near: float, there: float) -> tuple[int, int, int]:
    return WELL if value > near else NEAR if value > there else THERE


def _short(joint: str, side: str) -> str:
    return joint.removeprefix(f"{side}_").removesuffix("_joint").replace("_", " ")


def _bar_left(x: int) -> int:
    return x + 98


def _bar_width() -> int:
    return _COLUMN - 98 - 2 * _MARGIN


def _bar_top(row: int) -> int:
    return 12 + _ROW * row
