"""An operator who does as the test says, before a camera and a pose model made of exact numbers; all else is real."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from painted_person import BENT, DOWN, FORWARD, FPS, HEIGHT, LEFT, ORIGIN, WIDTH, limbs, look

from camera_client import session
from camera_client.board import Shown
from camera_client.frame import RgbdFrame
from camera_client.landmarks import Landmarks
from camera_client.run_report import RunReport
from camera_client.settings import Settings
from ik_client.state_machine import ArmState

LIMIT = 60.0
_BLACK = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
BOTH_ACTIVE = (ArmState.ACTIVE, ArmState.ACTIVE)
ASIDE = ORIGIN + np.array([-0.7, 0.0, -0.5])
"""Where a passer-by is, optical frame [m]."""


def swaying(t: float) -> np.ndarray:
    """Bent arms that move a little all the time."""
    up = 0.35 * math.sin(2.0 * t)
    left = DOWN + 0.3 * LEFT, FORWARD + 0.3 * LEFT - up * DOWN
    return limbs(left, (left[0] * [1, -1, 1], left[1] * [1, -1, 1]))


class Operator:
    """Source of frames and detector in one; change what it shows at any time.

    Attributes:
        held: The switch.
        body: Whether there is anybody.
        place: Where, optical frame [m].
        frames: Whether the camera gives frames.
        hidden: Arms out of view.
        finished: Whether the camera is gone.
        fault: Why.
        limbs: Where the arms are at a time [s].
        broken: Whether the pose model fails.
    """

    description = "an operator"
    has_depth = True
    age = 0.0

    def __init__(self) -> None:
        self.held: bool | None = False
        self.body = True
        self.place = ORIGIN
        self.frames = True
        self.hidden: tuple[int, ...] = ()
        self.finished = False
        self.fault = ""
        self.limbs: Callable[[float], np.ndarray] = swaying
        self.broken = False
        self._landmarks: Landmarks | None = None
        self._due = time.monotonic()

    def next(self, timeout: float) -> RgbdFrame | None:
        """A frame every thirtieth of a second."""
        self._due = max(self._due + 1.0 / FPS, time.monotonic() - 1.0 / FPS)
        time.sleep(min(max(self._due - time.monotonic(), 0.0), timeout))
        if not self.frames or self.finished:
            return None
        now = time.monotonic()
        frame, landmarks = look(now, self.limbs(now), self.place, self.hidden)
        self._landmarks = landmarks if self.body else None
        return replace(frame, colour=_BLACK)

    def detect(self, colour: np.ndarray, t_capture: float) -> Landmarks | None:
        """What a pose model would find."""
        if self.broken:
            raise RuntimeError("the model\nis broken")
        return self._landmarks

    def close(self) -> None:
        """Nothing is open."""


class Running:
    """A run of `ik-camera` in a thread.

    Attributes:
        shown: What was shown last.
        said: Lines that were said.
    """

    def __init__(self, monkeypatch: Any, operator: Operator, service: str, robot: str, **options: Any) -> None:
        monkeypatch.setattr(session, "source_of", lambda _settings: operator)
        monkeypatch.setattr(session, "detector_of", lambda *_: operator)
        monkeypatch.setattr("builtins.print", lambda line="", **_: self.said.append(str(line)))
        self.said: list[str] = []
        self.shown: Shown | None = None
        self.report: RunReport | None = None
        self.error: Exception | None = None
        self._end = threading.Event()
        settings = Settings(service=service, robot=robot, replay=Path("acted"), preview=False, **options)
        self._thread = threading.Thread(target=self._run, args=(settings,))

    def __enter__(self) -> "Running":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()

    def until(self, condition: Callable[[Shown], object]) -> Shown:
        """Wait until what is shown is as it should be."""
        end = time.monotonic() + LIMIT
        while self.shown is None or not condition(self.shown):
            assert self._thread.is_alive(), (self.error, self.said)
            assert time.monotonic() < end, (self.shown and (self.shown.arms, self.shown.trouble), self.said)
            time.sleep(0.01)
        return self.shown

    def soon(self, condition: Callable[[Shown], object], limit: float = 3.0) -> bool:
        """Whether what is shown is as it should be within a time [s]."""
        end = time.monotonic() + limit
        while self.shown is None or not condition(self.shown):
            if time.monotonic() > end:
                return False
            time.sleep(0.01)
        return True

    def ended(self) -> None:
        """Wait until the run has ended by itself."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()

    def _run(self, settings: Settings) -> None:
        try:
            self.report = session.run(
                settings, self.said.append, terminal=False, keep_going=lambda: not self._end.is_set(), watch=self._watch
            )
        except Exception as error:
            self.error = error

    def _watch(self, shown: Shown) -> None:
        self.shown = shown


__all__ = ["ASIDE", "BENT", "BOTH_ACTIVE", "LIMIT", "Operator", "Running", "swaying"]
