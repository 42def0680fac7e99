"""Who is rendered, and how: bodies, cameras and light, each for tuning or for judging, never for both.

What is tuned on says how to improve; what is judged on says how good it is. Nobody looks at the second while improving.
"""

from dataclasses import dataclass

import numpy as np
from choreography import FULL, Choreography
from drawn_dance import drawn_dance


@dataclass(frozen=True)
class Subject:
    """A person before a camera.

    Attributes:
        name: For tables and files.
        stretch: Of the mesh along the axes: depth, breadth, height.
        camera: Where the camera is [m]; the person stands at the origin and faces +x.
        pitch: How far the camera looks down [rad].
        gain: Exposure, 1 as rendered.
        grain: Standard deviation of the picture's noise, of 255.
    """

    name: str
    stretch: tuple[float, float, float]
    camera: tuple[float, float, float] = (2.9, 0.1, 1.15)
    pitch: float = 0.0
    gain: float = 1.0
    grain: float = 3.0


TUNING = (
    Subject("as_measured", (1.0, 1.0, 1.0)),
    Subject("short_and_broad", (1.05, 1.08, 0.92)),
    Subject("tall_and_slim", (0.94, 0.95, 1.07), (3.1, -0.1, 1.3), 0.07, 0.85, 5.0),
)
"""Seen while the chain was made."""

JUDGING = (
    Subject("a_little_taller", (0.98, 1.05, 1.04), (2.6, -0.15, 1.30), 0.10, 1.10, 4.0),
    Subject("small", (0.97, 0.94, 0.93), (2.8, 0.2, 1.00), 0.02, 0.90, 6.0),
    Subject("broad_and_deep", (1.10, 1.10, 1.00), (3.2, 0.0, 1.45), 0.16, 1.00, 3.0),
)
"""Never seen while the chain was made."""

TUNING_SEEDS = (1, 2, 3)
"""Of the drawn dances of the first."""
JUDGING_SEEDS = (101, 102, 103)
"""Of the drawn dances of the second."""


@dataclass(frozen=True)
class Take:
    """A dance of a subject.

    Attributes:
        subject: Who dances.
        title: What: "full", or "drawn" with its seed.
        dance: The same.
        fresh: Whether it is for judging.
    """

    subject: Subject
    title: str
    dance: Choreography
    fresh: bool

    @property
    def name(self) -> str:
        """Of its file."""
        return f"{self.subject.name}-{self.title}"

    def rng(self) -> np.random.Generator:
        """What the picture's noise is drawn from."""
        return np.random.default_rng([*self.name.encode(), 1])


def takes(fresh: bool) -> list[Take]:
    """The full dance and a drawn one of every subject of one kind."""
    out = []
    for subject, seed in zip(*((JUDGING, JUDGING_SEEDS) if fresh else (TUNING, TUNING_SEEDS)), strict=True):
        out.append(Take(subject, "full", FULL, fresh))
        out.append(Take(subject, f"drawn{seed}", drawn_dance(seed), fresh))
    return out
