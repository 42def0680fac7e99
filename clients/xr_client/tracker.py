"""Latest wins: packets in from a socket, hands out to the teleop loop. Two threads may use it, one for each side.

    socket    connect ─> feed, feed, ... ─> disconnect       stamps the arrival, drops what is old, reads the switches
    loop      hands, hands, ...                              freeze watch ─> rearm ─> reference

- Only the latest packet is kept. Nothing queues, so nothing grows and nothing is replayed.
- The arrival's time is the server's own. A page's time of capture tells samples apart, and is shown to people.
- Packets of a session that is not visible (a menu is in front of it), or whose head position is a guess, have lost
  hands: the operator cannot see, or nobody knows where the hands are.
- A closed connection is no hands at once, not the last ones for a while.
"""

from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np

from ik_client.hand import HandSample
from ik_client.types import Hands
from ik_proto import Array
from xr_client.frames import GripOffset, Side, pose_of, to_robot, wrist_of_grip, wrist_of_hand
from xr_client.freeze_watch import FreezeWatch
from xr_client.grip_switch import GripSwitch
from xr_client.look import Look
from xr_client.packet_order import PacketOrder
from xr_client.packets import HandPacket, Kind, PosePacket
from xr_client.rearm import Rearm
from xr_client.reference import Reference, StandingReference


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """A packet that was taken. Replaced as a whole, so that no thread sees half of one.

    Attributes:
        packet: The packet.
        look: What it says, in the robot's axes.
        origins: What the left and the right hand come from.
        time: When it arrived [s].
    """

    packet: PosePacket
    look: Look
    origins: tuple[Hashable, Hashable]
    time: float


class Tracker:
    """A headset as the teleop loop's `HandSource`.

    Attributes:
        order: Counts of the present connection.
        connections: How many there were.
    """

    def __init__(self, reference: Reference | None = None, grip_offset: GripOffset | None = None) -> None:
        """Start without a connection.

        Args:
            reference: The frame the hands are given in.
            grip_offset: Where the wrist is, seen from a controller.
        """
        self.order = PacketOrder()
        self.connections = 0
        self._reference = reference or StandingReference()
        self._grip_offset = grip_offset or GripOffset()
        self._switches = (GripSwitch(), GripSwitch())
        self._rearm = (Rearm(), Rearm())
        self._freeze = (FreezeWatch(), FreezeWatch())
        self._kinds = [Kind.NONE, Kind.NONE]
        self._latest: Arrival | None = None
        self._used: Arrival | None = None

    @property
    def latest(self) -> Arrival | None:
        """The latest packet taken; None without a connection."""
        return self._latest

    @property
    def used(self) -> Arrival | None:
        """The packet that the loop used last."""
        return self._used

    def connect(self) -> None:
        """Begin anew: a page has connected."""
        self.connections += 1
        self.order = PacketOrder()
        self._switches = (GripSwitch(), GripSwitch())
        self._latest = None

    def disconnect(self) -> None:
        """There are no hands any more: the page has gone."""
        self._latest = None

    def feed(self, packet: PosePacket, now: float) -> bool:
        """Take a packet.

        Args:
            packet: What came.
            now: When it came [s], monotonic, the loop's clock.

        Returns:
            Whether it counts; an old one is dropped.
        """
        if not self.order.accepts(packet):
            return False
        left, right = (self._sample(packet, side, now) for side in Side)
        head = None if packet.head is None else to_robot(pose_of(packet.head[:3], packet.head[3:]))
        # A hand that is out of sight for a moment comes back as what it was.
        self._kinds = [hand.kind or before for hand, before in zip(packet.hands, self._kinds, strict=True)]
        room = (self.connections, packet.epoch, packet.visible)
        origins = (*room, self._kinds[Side.LEFT]), (*room, self._kinds[Side.RIGHT])
        self._latest = Arrival(packet, Look(head, left, right), origins, now)
        return True

    def hands(self, now: float) -> Hands | None:
        """What the operator's hands do, for a tick of the loop; None without a connection."""
        arrival = self._latest
        if arrival is None:
            return None
        self._used = arrival
        left, right = (self._admit(arrival, side, now) for side in Side)
        return self._reference.hands(replace(arrival.look, left=left, right=right))

    def _admit(self, arrival: Arrival, side: Side, now: float) -> HandSample | None:
        sample = arrival.look.wrists[side]
        if sample is not None and sample.tracked and self._freeze[side].frozen(sample.pose[:3, 3], now):
            sample = replace(sample, tracked=False)
        return self._rearm[side].admit(sample, arrival.origins[side])

    def _sample(self, packet: PosePacket, side: Side, now: float) -> HandSample | None:
        hand = packet.hands[side]
        grip = self._switches[side].update(hand, now)
        if hand.kind is Kind.NONE:
            return None
        pose = self._wrist(hand, side)
        tracked = pose is not None and packet.visible and not packet.head_guessed
        return HandSample(np.eye(4) if pose is None else pose, grip, packet.capture_ms, tracked)

    def _wrist(self, hand: HandPacket, side: Side) -> Array | None:
        """The wrist in the room, robot axes; None where the headset does not see it."""
        if hand.pose is None:
            return None
        T = pose_of(hand.pose[:3], hand.pose[3:])
        return wrist_of_hand(T, side) if hand.kind is Kind.HAND else wrist_of_grip(T, self._grip_offset)
