"""Two habits of OpenWBT's own server that some of its clients count on; ours has neither unless asked.

- Lag: every request is answered with the result of the one before it, the first with a fixed refusal.
- Smoothing: a weighted moving filter over the answers.

Only requests in OpenWBT's form get them, so other clients of the same endpoint are served as ever. Nothing outlives the
connection; OpenWBT's server hands the last result of one client to the next.
"""

from concurrent.futures import Future

from ik_proto import JSON
from ik_proto.limits import OPENWBT_MARK
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.conversation import Conversation
from ik_service.dispatcher import Dispatcher

FIRST_LAGGED_REPLY = b'{"sol_q": null, "success": false, "error_msg": ""}'
"""What OpenWBT's server says before it has solved anything, byte for byte."""

_MARK = f'"{OPENWBT_MARK}"'.encode()


class OpenwbtConnection(Conversation):
    """Answers one connection the way its flags say."""

    def __init__(self, dispatcher: Dispatcher, smooth: bool, lag: bool) -> None:
        """Start without history.

        Args:
            dispatcher: Of this connection alone.
            smooth: Filter the solved joints.
            lag: Answer with the previous result.
        """
        super().__init__(dispatcher, JSON)
        self._smoothing = WeightedMovingFilter() if smooth else None
        self._lag = lag
        self._previous = FIRST_LAGGED_REPLY

    def answer(self, body: bytes, arrived: float) -> bytes | Future[bytes]:
        """Answer one JSON request with one JSON reply. Never raises."""
        if _MARK not in body:
            return super().answer(body, arrived)
        reply = self._dispatcher.answer(body, self._codec, arrived, self._smoothing)
        if not self._lag or not isinstance(reply, bytes):  # one too large to be OpenWBT's
            return reply
        reply, self._previous = self._previous, reply
        return reply
