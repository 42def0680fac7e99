"""What one TCP client may cost the others. The numbers are quoted in `proto/README.md`, and a test holds them to it."""

from dataclasses import dataclass

from ik_proto import MAX_FRAME_BYTES


@dataclass(frozen=True, slots=True)
class TcpLimits:
    """The limits of one server.

    Attributes:
        connections: Connections served at a time.
        silent_s: When all are taken, one that has said nothing for so long makes place for a new one [s].
        first_frame_s: The same for one that has not said anything yet [s]. It is not closed before its place is needed:
            OpenWBT's client connects when its program starts and asks when its simulation has loaded.
        frame_s: Time a frame may take from its first to its last byte [s], and again for every `frame_bytes` of it.
        frame_bytes: See `frame_s` [bytes].
        requests_per_s: Requests of one connection that are answered in a second; the others wait, unread if need be.
        burst: Requests that may be answered at once after a pause.
        waiting_requests: Requests of one connection that may wait for their answers, before no more are read.
        waiting_bytes: The same [bytes].
        unread_bytes: Replies that may wait in memory for a client to read them [bytes]; fits two of the largest.
        hopeless_bodies: Undecodable or unauthorized bodies in a row after which a connection is closed.
        handshake_s: Time a TLS handshake may take [s].
        linger_s: Time a refused client has to read its last reply [s].
        keepalive_s: Silence after which the system asks whether the other end still lives [s]; three questions a third
            of that apart go unanswered before the connection is closed.
        backlog: Connections that may wait to be accepted.
    """

    connections: int = 128
    silent_s: float = 60.0
    first_frame_s: float = 2.0
    frame_s: float = 1.0
    frame_bytes: int = 64 * 1024
    requests_per_s: float = 10_000.0
    burst: int = 1000
    waiting_requests: int = 256
    waiting_bytes: int = MAX_FRAME_BYTES
    unread_bytes: int = 2 * MAX_FRAME_BYTES
    hopeless_bodies: int = 16
    handshake_s: float = 2.0
    linger_s: float = 1.0
    keepalive_s: int = 15
    backlog: int = 1024
