"""Which packets of a connection count: sequence numbers and epochs.

| packet                                            | verdict | what follows                                      |
|---------------------------------------------------|---------|---------------------------------------------------|
| sequence number not larger than the last accepted | old     | dropped and counted                               |
| epoch smaller than the last accepted              | old     | dropped and counted: it is of a room that is gone |
| else                                              | new     | taken                                             |

A new connection begins anew. Numbers do not wrap: at 120 packets a second they last for a year.
"""

from xr_client.packets import PosePacket


class PacketOrder:
    """Judges the packets of one connection.

    Attributes:
        accepted: Packets taken.
        dropped: Packets dropped as old.
        missed: Sequence numbers between those taken that never came, or came late.
    """

    def __init__(self) -> None:
        """Start with a connection."""
        self.accepted = 0
        self.dropped = 0
        self.missed = 0
        self._seq = -1
        self._epoch = 0

    def accepts(self, packet: PosePacket) -> bool:
        """Say whether a packet counts, and remember it if it does."""
        if packet.seq <= self._seq or packet.epoch < self._epoch:
            self.dropped += 1
            return False
        if self.accepted:
            self.missed += packet.seq - self._seq - 1
        self._seq, self._epoch = packet.seq, packet.epoch
        self.accepted += 1
        return True
