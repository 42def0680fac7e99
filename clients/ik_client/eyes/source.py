"""Both ends of a way for eye images, whatever it runs over, and how a URL names one."""

import re
from types import TracebackType
from typing import Protocol, Self

from ik_client.address import parse_address
from ik_client.eyes.errors import EyesError
from ik_proto.stereo_packet import StereoFrame

FORMS = "shm:NAME or zenoh://HOST:PORT"

__all__ = ["FORMS", "EyePublisher", "EyeSource", "EyesError", "open_eyes", "open_publisher"]


class EyeSource(Protocol):
    """A watcher's end. As long as it is open and is asked, pictures are made."""

    @property
    def same_clock(self) -> bool:
        """Whether `taken_ms` is of this machine's monotonic clock, and may be compared with it."""
        ...

    def wait(self, after_seq: int, timeout: float) -> StereoFrame | None:
        """Wait for a newer picture.

        Args:
            after_seq: Number of the picture the caller has; -1 for none.
            timeout: How long at most [s].

        Returns:
            The newest picture; None where there is no other than the caller has.

        Raises:
            EyesError: Whoever sent them has ended.
        """
        ...

    def close(self) -> None:
        """Stop watching."""
        ...

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop watching."""
        ...


class EyePublisher(Protocol):
    """A robot's end."""

    @property
    def watched(self) -> bool:
        """Whether anybody watches: else no picture needs to be made."""
        ...

    @property
    def wanted(self) -> bool:
        """Whether somebody waits for a picture after the last; where that cannot be told, whether anybody watches."""
        ...

    def publish(self, frame: StereoFrame) -> None:
        """Send a picture, without waiting for anybody.

        Raises:
            StereoError: It is none.
        """
        ...

    def close(self) -> None:
        """End it; watchers are told."""
        ...


def open_eyes(url: str, robot: str) -> EyeSource:
    """Begin to watch.

    Args:
        url: Where; `shm:NAME` or `zenoh://HOST:PORT`.
        robot: Name of the robot.

    Raises:
        ValueError: The URL is none.
        EyesError: There are no pictures; says why.
    """
    if name := _block_name(url):
        from ik_client.eyes.shared import SharedEyes

        return SharedEyes(name)
    address = _zenoh_address(url)
    from ik_client.eyes.over_zenoh import ZenohEyes

    return ZenohEyes(url, address, robot)


def open_publisher(url: str, robot: str) -> EyePublisher:
    """Begin to send; arguments and errors are those of `open_eyes`."""
    if name := _block_name(url):
        from ik_client.eyes.shared import SharedEyePublisher

        return SharedEyePublisher(name)
    address = _zenoh_address(url)
    from ik_client.eyes.over_zenoh import ZenohEyePublisher

    return ZenohEyePublisher(url, address, robot)


def check_url(url: str) -> None:
    """Say whether a URL can name eye images, without opening anything.

    Raises:
        ValueError: It cannot.
    """
    if not _block_name(url):
        _zenoh_address(url)


def _block_name(url: str) -> str:
    """The name in `shm:NAME`; empty for another URL."""
    if not url.startswith("shm:"):
        return ""
    name = url.removeprefix("shm:")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", name):
        raise ValueError(f"{url!r} names no shared memory: a name has up to 64 letters, digits, dots and hyphens")
    return name


def _zenoh_address(url: str) -> str:
    """HOST:PORT of a `zenoh://` URL."""
    fault = ValueError(f"{url!r} is no place for eye images; write {FORMS}")
    try:
        address = parse_address(url)
    except ValueError:
        raise fault from None
    if address.scheme != "zenoh" or address.robot:
        raise fault
    return address.authority
