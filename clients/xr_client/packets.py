"""The pose packet: what a page in a headset sends once per frame. Binary, little-endian. Pure: no socket, no clock.

| offset | type        | field                                                                                       |
|--------|-------------|---------------------------------------------------------------------------------------------|
| 0      | u8          | 0x50, "P"                                                                                   |
| 1      | u8          | version, 1                                                                                  |
| 2      | u8          | session: 1 head tracked, 2 its position is a guess, 4 the session is visible                |
| 3      | u8          | left hand: 1 tracked, 2 a hand, 4 a controller, 8 joints follow, 16 pinch is known,         |
|        |             | 32 button A or X, 64 button B or Y, 128 thumbstick pressed                                  |
| 4      | u8          | right hand, the same                                                                        |
| 5      | u8 x 3      | 0                                                                                           |
| 8      | u32         | sequence number, rising by any amount from packet to packet                                 |
| 12     | u32         | epoch, rising when the room moves: recenter, hidden or blurred page, new session            |
| 16     | f64         | when the poses are from, by the page's clock [ms]                                           |
| 24     | f32 x 7     | head: x y z [m], quaternion x y z w                                                         |
| 52     | f32 x 12    | left hand: wrist or grip x y z [m], quaternion x y z w, trigger, squeeze (0 to 1),          |
|        |             | thumbstick x y (-1 to 1), pinch [m]                                                         |
| 100    | f32 x 12    | right hand, the same                                                                        |
| 148    | f32 x 25x3  | joints of the left hand, where its flag says so: x y z [m], in WebXR's order                |
| ...    | f32 x 25x3  | joints of the right hand, likewise                                                          |

All poses are WebXR's own, in a reference space with the floor at y = 0. What a flag says is not there is zero: the pose
of a head or hand that is not tracked, the trigger of a hand, the pinch of a controller. Exactly one encoding exists for
every content, so a packet that is accepted encodes to the same bytes.

A packet is accepted or refused as a whole, with a `PacketError` in one line. Positions are within 100 m, quaternions of
unit length to 1e-2.
"""

import math
import struct
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from ik_proto import Array

MAGIC, VERSION = 0x50, 1
JOINTS = 25
BASE_BYTES = 148
JOINT_BYTES = JOINTS * 3 * 4
MAX_PACKET_BYTES = BASE_BYTES + 2 * JOINT_BYTES
MAX_COUNT = 2**32 - 1
MAX_POSITION = 100.0
"""Largest coordinate [m]."""
MAX_PINCH = 1.0
"""Largest distance of two fingertips of a hand [m]."""

_HEAD = struct.Struct("<BBBBB3sIId")
_HEAD_TRACKED, _HEAD_GUESSED, _VISIBLE = 1, 2, 4
_TRACKED, _KIND_SHIFT, _JOINTS, _PINCH, _BUTTON_SHIFT = 1, 1, 8, 16, 5


class PacketError(ValueError):
    """Bytes that are no packet; the message says why, in one line."""


class Kind(IntEnum):
    """What a pose comes from."""

    NONE = 0
    HAND = 1
    CONTROLLER = 2


@dataclass(frozen=True, slots=True, eq=False)
class HandPacket:
    """One hand of a packet.

    Attributes:
        kind: What is tracked.
        pose: Position [m] and quaternion xyzw, shape (7,); None where it is not tracked.
        trigger: 0 to 1; 0 without a controller.
        squeeze: 0 to 1; 0 without a controller.
        stick: Thumbstick x and y, -1 to 1.
        buttons: A or X, B or Y, thumbstick pressed.
        pinch: Distance of the tips of thumb and index finger [m]; None where it is not known.
        joints: Positions of the hand's joints, shape (25, 3) [m]; None where they were not sent.
    """

    kind: Kind = Kind.NONE
    pose: Array | None = None
    trigger: float = 0.0
    squeeze: float = 0.0
    stick: tuple[float, float] = (0.0, 0.0)
    buttons: tuple[bool, bool, bool] = (False, False, False)
    pinch: float | None = None
    joints: Array | None = None


NO_HAND = HandPacket()


@dataclass(frozen=True, slots=True, eq=False)
class PosePacket:
    """What a headset saw in a frame.

    Attributes:
        seq: Number of the packet.
        epoch: Number of the room: another one means that poses are not to be compared with those before.
        capture_ms: When the poses are from, by the page's clock [ms].
        head: Position [m] and quaternion xyzw, shape (7,); None where it is not tracked.
        head_guessed: Whether the position of the head is a guess of the headset.
        visible: Whether the operator sees the page and not a menu in front of it.
        left: The left hand.
        right: The right hand.
    """

    seq: int
    epoch: int
    capture_ms: float
    head: Array | None = None
    head_guessed: bool = False
    visible: bool = True
    left: HandPacket = field(default=NO_HAND)
    right: HandPacket = field(default=NO_HAND)

    @property
    def hands(self) -> tuple[HandPacket, HandPacket]:
        """Left and right."""
        return self.left, self.right


def encode_packet(packet: PosePacket) -> bytes:
    """Write a packet.

    Args:
        packet: Its content.

    Returns:
        The bytes.

    Raises:
        PacketError: `decode_packet` would refuse them.
    """
    session = (
        _HEAD_TRACKED * (packet.head is not None) | _HEAD_GUESSED * packet.head_guessed | _VISIBLE * packet.visible
    )
    flags = [_flags(hand) for hand in packet.hands]
    numbers = [np.zeros(7) if packet.head is None else packet.head, *(_numbers(hand) for hand in packet.hands)]
    numbers += [hand.joints.reshape(-1) for hand in packet.hands if hand.joints is not None]
    try:
        head = _HEAD.pack(MAGIC, VERSION, session, *flags, bytes(3), packet.seq, packet.epoch, packet.capture_ms)
    except struct.error as error:
        raise PacketError(f"the packet's counts must be whole numbers from 0 to {MAX_COUNT}: {error}") from None
    data = head + np.concatenate(numbers).astype("<f4").tobytes()
    decode_packet(data)
    return data


def decode_packet(data: bytes) -> PosePacket:
    """Read a packet.

    Args:
        data: The bytes of one packet.

    Returns:
        Its content. Quaternions are as they came, of unit length to 1e-2.

    Raises:
        PacketError: They are none.
    """
    if len(data) < BASE_BYTES:
        raise PacketError(f"a pose packet has at least {BASE_BYTES} bytes, not {len(data)}")
    magic, version, session, left, right, padding, seq, epoch, capture_ms = _HEAD.unpack_from(data)
    if magic != MAGIC:
        raise PacketError(f"a pose packet begins with {MAGIC:#04x}, not {magic:#04x}")
    if version != VERSION:
        raise PacketError(f"pose packets of version {version} are not known here, only {VERSION}: reload the page")
    size = BASE_BYTES + JOINT_BYTES * (bool(left & _JOINTS) + bool(right & _JOINTS))
    if len(data) != size:
        raise PacketError(f"a pose packet with these flags has {size} bytes, not {len(data)}")
    if session & ~7 or any(padding):
        raise PacketError("a pose packet's unused bits must be zero")
    if not math.isfinite(capture_ms):
        raise PacketError("the capture time is not a finite number")
    numbers = np.frombuffer(data, "<f4", offset=_HEAD.size).astype(np.float64)
    if not np.isfinite(numbers).all():
        raise PacketError("a pose packet's numbers must be finite")
    head = _pose(numbers[:7], bool(session & _HEAD_TRACKED), "the head")
    if head is None and session & _HEAD_GUESSED:
        raise PacketError("the head is not tracked, so its position cannot be a guess")
    joints = iter(numbers[31:].reshape(-1, JOINTS, 3))
    return PosePacket(
        seq=seq,
        epoch=epoch,
        capture_ms=capture_ms,
        head=head,
        head_guessed=bool(session & _HEAD_GUESSED),
        visible=bool(session & _VISIBLE),
        left=_hand(left, numbers[7:19], next(joints) if left & _JOINTS else None, "the left hand"),
        right=_hand(right, numbers[19:31], next(joints) if right & _JOINTS else None, "the right hand"),
    )


def _flags(hand: HandPacket) -> int:
    flags = _TRACKED * (hand.pose is not None) | hand.kind << _KIND_SHIFT
    flags |= _JOINTS * (hand.joints is not None) | _PINCH * (hand.pinch is not None)
    return flags | sum(pressed << k + _BUTTON_SHIFT for k, pressed in enumerate(hand.buttons))


def _numbers(hand: HandPacket) -> Array:
    pose = [0.0] * 7 if hand.pose is None else list(hand.pose)
    return np.array([*pose, hand.trigger, hand.squeeze, *hand.stick, hand.pinch or 0.0])


def _pose(numbers: Array, tracked: bool, what: str) -> Array | None:
    if not tracked:
        _require_zero(numbers, what, "is not tracked, so its pose")
        return None
    if np.abs(numbers[:3]).max() > MAX_POSITION:
        raise PacketError(f"{what} is more than {MAX_POSITION:g} m away")
    if not abs(math.hypot(*numbers[3:].tolist()) - 1.0) <= 1e-2:
        raise PacketError(f"{what} has a quaternion that is not of unit length")
    return numbers


def _hand(flags: int, numbers: Array, joints: Array | None, what: str) -> HandPacket:
    kind = flags >> _KIND_SHIFT & 3
    if kind > Kind.CONTROLLER:
        raise PacketError(f"{what} is both a hand and a controller")
    if kind is Kind.NONE and flags:
        raise PacketError(f"{what} has flags, but is neither a hand nor a controller")
    pose = _pose(numbers[:7], bool(flags & _TRACKED), what)
    trigger, squeeze, x, y, pinch = numbers[7:].tolist()
    if kind == Kind.CONTROLLER:
        if flags & (_JOINTS | _PINCH):
            raise PacketError(f"{what} is a controller, which has no joints and no pinch")
        if not (0.0 <= trigger <= 1.0 and 0.0 <= squeeze <= 1.0 and abs(x) <= 1.0 and abs(y) <= 1.0):
            raise PacketError(f"{what} has a trigger or squeeze beyond 0 to 1, or a thumbstick beyond -1 to 1")
    else:
        if flags >> _BUTTON_SHIFT:
            raise PacketError(f"{what} is no controller, so it has no buttons")
        _require_zero(numbers[7:11], what, "is no controller, so its trigger, squeeze and thumbstick")
    if not flags & _PINCH:
        _require_zero(numbers[11:], what, "has no known pinch, so that")
    elif not 0.0 <= pinch <= MAX_PINCH:
        raise PacketError(f"{what} has a pinch beyond 0 to {MAX_PINCH:g} m")
    if joints is not None and np.abs(joints).max() > MAX_POSITION:
        raise PacketError(f"{what} has joints more than {MAX_POSITION:g} m away")
    return HandPacket(
        kind=Kind(kind),
        pose=pose,
        trigger=trigger,
        squeeze=squeeze,
        stick=(x, y),
        buttons=(bool(flags & 32), bool(flags & 64), bool(flags & 128)),
        pinch=pinch if flags & _PINCH else None,
        joints=joints,
    )


def _require_zero(numbers: Array, what: str, why: str) -> None:
    """Zero to the bit: minus zero would be a second encoding of the same content."""
    if numbers.any() or np.signbit(numbers).any():
        raise PacketError(f"{what} {why} must be zero")
