"""One TCP connection's requests, in the form the TCP server wants them answered: a dispatcher, and a codec for it."""

from concurrent.futures import Future

from ik_proto import Codec, Status
from ik_service.dispatcher import Dispatcher


class Conversation:
    """Answers the requests of one connection; see `ik_service.tcp_connection.Answerer`."""

    def __init__(self, dispatcher: Dispatcher, codec: Codec) -> None:
        """Take what answers.

        Args:
            dispatcher: Of this connection alone.
            codec: How requests and replies are encoded.
        """
        self._dispatcher = dispatcher
        self._codec = codec

    @property
    def hopeless(self) -> int:
        """How many bodies in a row were undecodable, or not admitted."""
        return self._dispatcher.hopeless

    def answer(self, body: bytes, arrived: float) -> bytes | Future[bytes]:
        """Answer a body that arrived at a time, now or later."""
        return self._dispatcher.answer(body, self._codec, arrived)

    def refuse(self, body: bytes, status: Status, message: str) -> bytes:
        """Answer a body without doing what it asks."""
        return self._dispatcher.refuse(body, self._codec, status, message)

    def stream_of(self, body: bytes) -> str:
        """Tell which stream a body that has to wait belongs to; empty for none."""
        return self._dispatcher.stream_of(body, self._codec)

    def supersede(self, stream: str) -> None:
        """Answer what waits for the worker and belongs to this stream."""
        self._dispatcher.supersede(stream)
