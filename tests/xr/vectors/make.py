"""Writes the golden vectors of the pose and video packets: bytes and what they say, for a test in any language.

    python tests/xr/vectors/make.py

Run it only when the format changes, with a new version number. `accepted.json`: packets and their content. Numbers are
exact in float32, so a reader may compare without a tolerance. `refused.json`: packets that must be refused, and why.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ik_proto.stereo_packet import StereoFrame, encode_frame
from xr_client.packets import JOINTS, HandPacket, Kind, PosePacket, encode_packet

FOLDER = Path(__file__).parent
TURNED = np.array([0.25, 1.125, -0.5, 0.5, -0.5, 0.5, 0.5])
HEAD = np.array([0.0, 1.625, 0.125, 0.0, 0.0, 0.0, 1.0])
FINGERS = np.arange(3 * JOINTS, dtype=float).reshape(JOINTS, 3) / 64.0

POSES = {
    "nothing is tracked": PosePacket(seq=0, epoch=0, capture_ms=0.0, visible=False),
    "a head that is guessed": PosePacket(seq=1, epoch=1, capture_ms=16.5, head=HEAD, head_guessed=True),
    "two hands with joints": PosePacket(
        seq=2**32 - 1,
        epoch=7,
        capture_ms=1763793479123.25,
        head=HEAD,
        left=HandPacket(Kind.HAND, TURNED, pinch=0.015625, joints=FINGERS),
        right=HandPacket(Kind.HAND, TURNED * [-1, 1, 1, 1, 1, 1, 1], pinch=0.0, joints=-FINGERS - 1.0),
    ),
    "two controllers": PosePacket(
        seq=3,
        epoch=1,
        capture_ms=33.0,
        head=HEAD,
        left=HandPacket(Kind.CONTROLLER, TURNED, 0.25, 1.0, (-1.0, 0.5), (True, False, True)),
        right=HandPacket(Kind.CONTROLLER, TURNED, 1.0, 0.0, (0.0, 0.0), (False, True, False)),
    ),
    "a hand and a controller that is lost but squeezed": PosePacket(
        seq=4,
        epoch=2,
        capture_ms=44.0,
        head=HEAD,
        left=HandPacket(Kind.HAND, TURNED, joints=FINGERS),
        right=HandPacket(Kind.CONTROLLER, None, squeeze=0.75),
    ),
    "a hand that is lost": PosePacket(seq=5, epoch=2, capture_ms=55.0, head=HEAD, left=HandPacket(Kind.HAND)),
}

FRAME = StereoFrame(seq=258, taken_ms=1234.5, left=b"left image", right=b"right", fov_deg=60.25)


def content(packet: PosePacket) -> dict[str, Any]:
    """A packet as JSON has it."""
    return json.loads(json.dumps(asdict(packet), default=lambda value: value.tolist()))


def spoiled(data: bytes, offset: int, new: bytes) -> str:
    """A packet with some bytes replaced, in hex."""
    return (data[:offset] + new + data[offset + len(new) :]).hex()


def refused() -> dict[str, str]:
    """Packets that must be refused, in hex, by what is wrong with them."""
    hands, controllers = encode_packet(POSES["two hands with joints"]), encode_packet(POSES["two controllers"])
    nan, two = np.float32("nan").tobytes(), np.float32(2.0).tobytes()
    return {
        "empty": "",
        "too short": controllers[:-1].hex(),
        "too long": (controllers + b"\0").hex(),
        "another magic number": spoiled(controllers, 0, b"V"),
        "another version": spoiled(controllers, 1, b"\x02"),
        "joints that are announced but do not follow": hands[:-300].hex(),
        "an unused session bit": spoiled(controllers, 2, b"\x0d"),
        "padding that is not zero": spoiled(controllers, 7, b"\x01"),
        "a capture time that is not finite": spoiled(controllers, 16, np.float64("inf").tobytes()),
        "not a number": spoiled(controllers, 24, nan),
        "not a number among the joints": spoiled(hands, 744, nan),
        "a quaternion that is not of unit length": spoiled(controllers, 48, two),
        "a head 128 m away": spoiled(controllers, 24, np.float32(128.0).tobytes()),
        "a hand that is a controller": spoiled(controllers, 3, b"\x07"),
        "a pose without a hand": spoiled(controllers, 3, b"\x01"),
        "a trigger beyond one": spoiled(controllers, 80, two),
        "a pinch of a controller": spoiled(controllers, 96, np.float32(0.5).tobytes()),
        "a pose of a hand that is not tracked": spoiled(controllers, 3, b"\x04"),
        "minus zero in a pose that is not there": spoiled(
            encode_packet(POSES["nothing is tracked"]), 24, np.float32(-0.0).tobytes()
        ),
    }


def documents() -> dict[str, str]:
    """The files by name."""
    accepted = {
        "pose": [
            {"name": name, "hex": encode_packet(packet).hex(), "content": content(packet)}
            for name, packet in POSES.items()
        ],
        "video": {
            "hex": encode_frame(FRAME).hex(),
            "content": asdict(FRAME) | {"left": FRAME.left.decode(), "right": FRAME.right.decode()},
        },
    }
    rejected = [{"name": name, "hex": data} for name, data in refused().items()]
    return {name: json.dumps(value) + "\n" for name, value in (("accepted.json", accepted), ("refused.json", rejected))}


if __name__ == "__main__":
    for name, text in documents().items():
        (FOLDER / name).write_text(text)
