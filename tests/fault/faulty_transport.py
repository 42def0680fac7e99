"""The faults of a network around any transport of `IKClient`, for those whose bytes no proxy can cut, such as Zenoh.

What is lost here is lost at once: the transport's own waiting is tested where it is written.
"""

from faults import LOSES, Fault, Plan

from ik_client.transport import Transport


class FaultyTransport:
    """Treats messages as plans say."""

    def __init__(self, inner: Transport, to_service: Plan | None = None, to_client: Plan | None = None) -> None:
        """Wrap a transport.

        Args:
            inner: What carries the messages that get through.
            to_service: What happens to requests.
            to_client: What happens to replies.
        """
        self.codec = inner.codec
        self.shows_token = inner.shows_token
        self.inner = inner
        self.to_service = to_service or Plan()
        self.to_client = to_client or Plan()
        self._late: list[bytes] = []

    def request(self, body: bytes, deadline: float) -> bytes:
        """Send a request and wait for its reply, or for what the network makes of it."""
        match self.to_service.next():
            case fault if fault in LOSES:
                raise TimeoutError
            case Fault.CORRUPT:
                body = _spoiled(body)
            case Fault.DUPLICATE:
                self.inner.request(body, deadline)
        reply = self.inner.request(body, deadline)
        fault = self.to_client.next()
        if self._late:
            self._late.append(reply)
            return self._late.pop(0)
        match fault:
            case Fault.TRUNCATE:
                return reply[: len(reply) // 2]
            case Fault.CORRUPT:
                return _spoiled(reply)
            case Fault.LATE:
                self._late.append(reply)
                raise TimeoutError
            case Fault.DUPLICATE:
                self._late.append(reply)
                return reply
            case fault if fault in LOSES:
                raise TimeoutError
        return reply

    def mend(self) -> None:
        """Let everything pass from now on; what was late is forgotten."""
        self.to_service.mend()
        self.to_client.mend()
        self._late.clear()

    def reset(self) -> None:
        """Start afresh; what is late in the network comes all the same."""
        self.inner.reset()

    def close(self) -> None:
        """Close the transport inside."""
        self.inner.close()


def _spoiled(body: bytes) -> bytes:
    return b"\xc1" + body[1:]  # in no UTF-8 text, and a code that MessagePack never uses
