"""The preview: the camera's picture, the skeleton coloured by confidence, and beside it what the operator must know.

Drawn into an array, so that it is the same in a window, in a file and in a test. The picture is shown as in a mirror,
as people expect of themselves; what the pose model gets never is.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camera_client.board import Shown
from camera_client.estimate import ArmsEstimate
from camera_client.landmarks import TRACKED
from ik_client.arm_joints import SIDES
from ik_client.state_machine import ArmState
from ik_proto import Array

PICTURE = (640, 360)
"""Width and height of the camera's picture [pixel]; one of another shape is fitted into it."""
PANEL = 320
"""Width of what is beside it [pixel]."""
SIZE = (PICTURE[0] + PANEL, PICTURE[1])

Colour = tuple[int, int, int]
_BACK: Colour = (24, 26, 30)
_TEXT: Colour = (225, 228, 232)
_FAINT: Colour = (140, 146, 154)
_GREEN: Colour = (70, 200, 110)
_AMBER: Colour = (240, 175, 50)
_RED: Colour = (230, 80, 70)
_STATES = {ArmState.ACTIVE: _GREEN, ArmState.ALIGNING: _AMBER, ArmState.HOLD: _AMBER, ArmState.FAULT: _RED}
_BONES = ((0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (6, 7), (0, 6), (3, 7))
"""Pairs of tracked joints: both arms, shoulders, hips, flanks."""
_MOST_LETTERS = 43
"""Of a line of the panel."""


class Preview:
    """Draws pictures, one after the other into the same memory."""

    def __init__(self) -> None:
        """Prepare."""
        import cv2

        self._cv: Any = cv2
        self._canvas = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)

    def draw(self, shown: Shown, hint: str = "") -> NDArray[np.uint8]:
        """Draw what is shown.

        Args:
            shown: All of it.
            hint: What the keys do, a line for the foot.

        Returns:
            Red, green, blue, shape `(SIZE[1], SIZE[0], 3)`; valid until the next call.
        """
        self._canvas[:] = _BACK
        self._picture(shown)
        self._panel(shown, hint)
        return self._canvas

    def _picture(self, shown: Shown) -> None:
        look, cv = shown.look, self._cv
        if look is None or look.frame.colour is None:
            self._write("no picture", (20, 40), _FAINT, 0.6)
            return
        colour = look.frame.colour
        scale = min(PICTURE[0] / colour.shape[1], PICTURE[1] / colour.shape[0])
        width, height = round(scale * colour.shape[1]), round(scale * colour.shape[0])
        small = cv.resize(colour, (width, height), interpolation=cv.INTER_AREA) if scale != 1.0 else colour
        self._canvas[:height, :width] = small[:, ::-1]
        if look.landmarks is None:
            return
        pixels = look.landmarks.pixels[TRACKED] * scale
        pixels[:, 0] = width - 1 - pixels[:, 0]
        trust = _trust(look.estimate, look.landmarks.visibility[TRACKED])
        for a, b in _BONES:
            if np.isfinite(pixels[[a, b]]).all():
                cv.line(self._canvas, _at(pixels[a]), _at(pixels[b]), _shade(min(trust[a], trust[b])), 3, cv.LINE_AA)
        for pixel, one in zip(pixels, trust, strict=True):
            if np.isfinite(pixel).all():
                cv.circle(self._canvas, _at(pixel), 5, _shade(one), -1, cv.LINE_AA)
        self._canvas[:, PICTURE[0] :] = _BACK

    def _panel(self, shown: Shown, hint: str) -> None:
        x, y = PICTURE[0] + 14, 26
        held = {True: ("switch: held", _GREEN), False: ("switch: open", _FAINT), None: ("switch: not known", _RED)}
        self._write(*_placed(held[shown.switch], (x, y)), 0.55)
        y += 30
        for side, words, state in zip(SIDES, shown.arms, shown.states, strict=True):
            self._write(f"{side} arm", (x, y), _STATES.get(state, _FAINT), 0.5)
            y = self._wrapped(words, (x, y + 18), _TEXT) + 8
        self._write(f"operator: {shown.operator}"[:_MOST_LETTERS], (x, y), _TEXT, 0.42)
        y += 22
        if shown.trouble:
            y = self._wrapped(shown.trouble, (x, y), _RED) + 4
        y = max(y, SIZE[1] - 24 - 16 * len(shown.latency_ms))
        for name, ms in shown.latency_ms.items():
            self._write(f"{name:<10}", (x, y), _FAINT, 0.4)
            self._write("-" if ms is None else f"{ms:6.1f} ms", (x + 110, y), _TEXT, 0.4)
            y += 16
        self._write(hint, (x, SIZE[1] - 10), _FAINT, 0.4)

    def _wrapped(self, text: str, at: tuple[int, int], colour: Colour) -> int:
        """Write in lines; give where the next one goes."""
        x, y = at
        line = ""
        for word in [*text.split(), None]:
            if word is None or len(line) + len(word) >= _MOST_LETTERS:
                self._write(line, (x, y), colour, 0.42)
                line, y = "", y + 16
            if word is not None:
                line += f" {word}" if line else word
        return y

    def _write(self, text: str, at: tuple[int, int], colour: Colour, size: float) -> None:
        cv = self._cv
        cv.putText(self._canvas, text, at, cv.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv.LINE_AA)


def _placed(text: tuple[str, Colour], at: tuple[int, int]) -> tuple[str, tuple[int, int], Colour]:
    return text[0], at, text[1]


def _trust(estimate: ArmsEstimate | None, visibility: Array) -> Array:
    """How far each joint is to be trusted, 0 to 1, shape (8,): arms as estimated, hips as the model sees them."""
    trust = visibility.copy()
    if estimate is not None:
        arms = np.stack([estimate.tracked, estimate.elbow_confidence, estimate.confidence], axis=1)
        trust[:6] = np.minimum(arms.astype(float), estimate.tracked[:, None]).ravel()
    return trust


def _shade(trust: float) -> Colour:
    """From red over amber to green."""
    low, high, share = (_RED, _AMBER, 2.0 * trust) if trust < 0.5 else (_AMBER, _GREEN, 2.0 * trust - 1.0)
    r, g, b = (round(a + share * (b - a)) for a, b in zip(low, high, strict=True))
    return r, g, b


def _at(pixel: Array) -> tuple[int, int]:
    return round(float(pixel[0])), round(float(pixel[1]))
