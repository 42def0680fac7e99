"""Eye images over Zenoh, under the key `ik/<robot>/eyes`.

- Both ends are clients of whoever listens at the address: a router, or an IK service, which passes them on.
- A picture that cannot be sent at once is dropped. The publisher asks Zenoh whether anybody subscribes.
- Two machines' clocks differ: `taken_ms` is the sender's, and a watcher on another machine must not compare it with its
  own.
"""

import time
from types import TracebackType
from typing import Self

import zenoh

from ik_client.background import Background
from ik_client.eyes.errors import EyesError
from ik_client.transport_zenoh import session_config
from ik_proto.stereo_packet import StereoError, StereoFrame, decode_frame, encode_frame

_POLL = 0.002
_OPEN_SECONDS = 3.0
_CLOSE_SECONDS = 0.5


class ZenohEyes:
    """A watcher's end; fits `EyeSource`."""

    same_clock = False

    def __init__(self, url: str, address: str, robot: str) -> None:
        """Begin to watch.

        Args:
            url: As it was given.
            address: Where a router or a service listens [HOST:PORT].
            robot: Name of the robot.

        Raises:
            EyesError: Nobody is there.
        """
        self.url = url
        self._session = _open(url, address)
        try:
            # A ring of one: the newest picture replaces one that was not taken.
            self._pictures = self._session.declare_subscriber(_key(robot), zenoh.handlers.RingChannel(1))
        except zenoh.ZError as error:
            _close(self._session)
            raise EyesError(url, f"cannot be watched ({str(error).splitlines()[0]})") from None

    def wait(self, after_seq: int, timeout: float) -> StereoFrame | None:
        """Wait for a newer picture; see `EyeSource`."""
        end = time.monotonic() + timeout
        while True:
            try:
                sample = self._pictures.try_recv()
            except zenoh.ZError:
                raise EyesError(self.url, "the Zenoh session has ended") from None
            frame = None if sample is None else _frame(sample.payload.to_bytes())
            if frame is not None and frame.seq != after_seq:
                return frame
            left = end - time.monotonic()
            if left <= 0.0:
                return None
            time.sleep(min(_POLL, left))

    def close(self) -> None:
        """Stop watching."""
        _close(self._session)

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop watching."""
        self.close()


class ZenohEyePublisher:
    """A robot's end; fits `EyePublisher`."""

    def __init__(self, url: str, address: str, robot: str) -> None:
        """Begin to send; arguments and errors are those of `ZenohEyes`."""
        self._session = _open(url, address)
        try:
            self._publisher = self._session.declare_publisher(
                _key(robot), congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.DATA_LOW
            )
        except zenoh.ZError as error:
            _close(self._session)
            raise EyesError(url, f"cannot be used ({str(error).splitlines()[0]})") from None

    @property
    def watched(self) -> bool:
        """Whether anybody subscribes."""
        return self._publisher.matching_status.matching  # ty: ignore[missing-attribute]  # the stub says bool

    @property
    def wanted(self) -> bool:
        """Whether anybody watches; what a watcher has is not known here."""
        return self.watched

    def publish(self, frame: StereoFrame) -> None:
        """Send a picture, or drop it."""
        self._publisher.put(encode_frame(frame))

    def close(self) -> None:
        """Close the session; a second call does nothing."""
        _close(self._session)


def _key(robot: str) -> str:
    return f"ik/{robot}/eyes"


def _frame(packet: bytes) -> StereoFrame | None:
    """A picture; None for what is none, because anybody may write to a key."""
    try:
        return decode_frame(packet)
    except StereoError:
        return None


def _open(url: str, address: str) -> zenoh.Session:
    config = session_config(address)
    opening = Background(lambda: zenoh.open(config))
    if not opening.wait(_OPEN_SECONDS):
        opening.abandon(_close)
        raise EyesError(url, f"nobody answers at {address}: start an IK service or a Zenoh router there")
    try:
        return opening.result()
    except zenoh.ZError:
        raise EyesError(url, f"nobody is at {address}: start an IK service or a Zenoh router there") from None


def _close(session: zenoh.Session) -> None:
    """Close a session; towards a hung peer that takes 10 s, which a thread waits for."""
    Background(session.close).wait(_CLOSE_SECONDS)
