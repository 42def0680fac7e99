"""The window's view: a compass for each hand with the asked and the achieved velocity, bars, words.

Forward is up in a compass and left is left, as on the stick; the bar beside it is up and down. Grey is what was asked,
colour is what comes of it.
"""

import numpy as np

from gamepad_client.status import Hand, Status
from ik_client.arm_joints import SIDES
from ik_client.state_machine import ArmState
from ik_proto import Array

SIZE = (640, 400)
"""Width and height [pixels]."""

_BACK, _PANEL, _DIM, _TEXT = (24, 26, 30), (36, 39, 45), (120, 126, 135), (230, 232, 235)
_ASKED, _MOVES, _SLOWED = (150, 156, 165), (96, 200, 120), (240, 180, 70)
_STATES = {
    ArmState.DISARMED: _DIM,
    ArmState.ALIGNING: _SLOWED,
    ArmState.ACTIVE: _MOVES,
    ArmState.HOLD: _SLOWED,
    ArmState.FAULT: (235, 90, 80),
}
_RADIUS = 62


class Picture:
    """Draws statuses; needs no window."""

    def __init__(self) -> None:
        """Load the fonts that come with pygame."""
        import pygame

        self._pygame = pygame
        pygame.font.init()
        self._large, self._small = pygame.font.Font(None, 34), pygame.font.Font(None, 20)
        self._surface = pygame.Surface(SIZE)

    def draw(self, status: Status) -> Array:
        """Draw a status.

        Returns:
            RGB, shape (h, w, 3), uint8.
        """
        self._surface.fill(_BACK)
        self._text(self._large, str(status.state), (20, 16), _STATES[status.state])
        words = status.reason or ("going home" if status.homing else "")
        self._text(self._small, words or ("" if status.state is ArmState.ACTIVE else status.hint), (20, 46), _TEXT)
        self._text(self._small, f"{status.speed:.2f} m/s   axes of the {status.frame}", (420, 22), _TEXT)
        for side, hand in enumerate(status.hands):
            self._hand(side, hand, status.speed)
        self._text(self._small, f"{status.device}:  {status.hint}", (20, 376), _DIM)
        return np.ascontiguousarray(self._pygame.surfarray.array3d(self._surface).swapaxes(0, 1))

    def _hand(self, side: int, hand: Hand, speed: float) -> None:
        draw, left = self._pygame.draw, 20 + side * 310
        draw.rect(self._surface, _PANEL, (left, 74, 290, 290), border_radius=8)
        self._text(self._small, f"{SIDES[side]} hand", (left + 14, 84), _TEXT)
        centre = np.array([left + 110.0, 184.0])
        draw.circle(self._surface, _DIM, centre, _RADIUS, 1)
        column = (left + 225, 184)
        draw.rect(self._surface, _DIM, (column[0] - 8, column[1] - _RADIUS, 16, 2 * _RADIUS), 1)
        moves = _SLOWED if hand.limit else _MOVES
        for twist, colour, wide in ((hand.asked, _ASKED, 7), (hand.achieved, moves, 3)):
            if twist is None:
                continue
            way = np.clip(np.asarray(twist[:3]) / max(speed, 1e-6), -1.0, 1.0) * _RADIUS
            # Forward is up on the screen, left is left.
            draw.line(self._surface, colour, centre, centre - (way[1], way[0]), wide)
            draw.rect(self._surface, colour, (column[0] - wide, column[1] - max(way[2], 0.0), 2 * wide, abs(way[2])))
        turning = " ".join(f"{value + 0.0:+.2f}" for value in hand.asked[3:])
        self._text(self._small, f"turn {turning} rad/s", (left + 14, 262), _TEXT if hand.asked[3:].any() else _DIM)
        self._text(self._small, "manipulability", (left + 14, 290), _DIM)
        draw.rect(self._surface, _BACK, (left + 120, 292, 150, 10), border_radius=4)
        if hand.manipulability is not None:
            wide = max(4, round(150 * hand.manipulability))
            colour = _SLOWED if hand.damped else _MOVES
            draw.rect(self._surface, colour, (left + 120, 292, wide, 10), border_radius=4)
        self._text(self._small, "slowed by", (left + 14, 316), _DIM)
        self._text(self._small, hand.limit or "nothing", (left + 14, 336), _SLOWED if hand.limit else _DIM)

    def _text(self, font, words: str, place: tuple[int, int], colour: tuple[int, int, int]) -> None:
        self._surface.blit(font.render(words, True, colour), place)
