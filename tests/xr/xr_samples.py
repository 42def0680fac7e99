"""Poses, packets and captured hands for the tests of the XR client."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from ik_client.rotation import rotation_matrix
from xr_client.packets import HandPacket, Kind, PosePacket

HAND_JOINTS = [
    "wrist",
    *(f"thumb-{part}" for part in ("metacarpal", "phalanx-proximal", "phalanx-distal", "tip")),
    *(
        f"{finger}-finger-{part}"
        for finger in ("index", "middle", "ring", "pinky")
        for part in ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
    ),
]
"""WebXR's joints of a hand, in its order."""

LEVEL = np.array([0.0, 1.6, 0.0, 0.0, 0.0, 0.0, 1.0])
"""A head at 1.6 m that looks straight ahead: position, quaternion xyzw."""


def read_hand(file: Path) -> np.ndarray:
    """Joints of a captured hand, shape (25, 4, 4) [m], in the axes of its own file."""
    found = dict(re.findall(r"'?([\w-]+)'?: \{\s*offsetMatrix: (\[[^\]]*\])", file.read_text()))
    matrices = [json.loads(re.sub(r",\s*\]", "]", found[name])) for name in HAND_JOINTS]
    return np.array(matrices).reshape(25, 4, 4).transpose(0, 2, 1)


def vectors(bound: float) -> st.SearchStrategy[np.ndarray]:
    return st.tuples(*[st.floats(-bound, bound)] * 3).map(np.array)


@st.composite
def poses(draw) -> np.ndarray:
    """Any pose within 5 m."""
    return pose(draw(vectors(5.0)), draw(vectors(1.8)))


def pose(position, rotation=(0.0, 0.0, 0.0)) -> np.ndarray:
    """A pose of a position [m] and a rotation vector [rad]."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation_matrix(np.asarray(rotation, dtype=float)), position
    return T


def at(x=0.0, y=1.2, z=-0.4) -> np.ndarray:
    """An unturned pose in WebXR's axes: position, quaternion xyzw."""
    return np.array([x, y, z, 0.0, 0.0, 0.0, 1.0])


def controller(where, squeeze=0.0) -> HandPacket:
    return HandPacket(Kind.CONTROLLER, where, squeeze=squeeze)


def hand(where, pinch=0.1) -> HandPacket:
    return HandPacket(Kind.HAND, where, pinch=pinch)


def packet(seq, **others: Any) -> PosePacket:
    """A packet of a level head and of the hands given."""
    return replace(PosePacket(seq, 1, seq * 11.0, LEVEL), **others)
