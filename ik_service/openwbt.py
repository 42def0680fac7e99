"""Two habits of OpenWBT's own server that some of its clients count on; ours has neither unless asked.

- Lag: every request is answered with the result of the one before it, the first with a fixed refusal.
- Smoothing: a weighted moving filter over the answers.

Only requests in OpenWBT's form get them, so other clients of the same endpoint are served as ever. Nothing outlives the
connection; OpenWBT's server hands the last result of one client to the next.
"""

from concurrent.futures import Future

from ik_proto import JSON
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.service import Service
from ik_service.tcp_server import Answer

FIRST_LAGGED_REPLY = b'{"sol_q": null, "success": false, "error_msg": ""}'
"""What OpenWBT's server says before it has solved anything, byte for byte."""

_MARK = b'"current_lr_arm_q"'


class OpenwbtConnection:
    """Answers one connection the way its flags say."""

    def __init__(self, service: Service, others: Answer, smooth: bool, lag: bool) -> None:
        """Start without history.

        Args:
            service: Answers the requests in OpenWBT's form, which are all plain solves.
            others: Answers the others.
            smooth: Filter the solved joints.
            lag: Answer with the previous result.
        """
        self._service = service
        self._others = others
        self._smoothing = WeightedMovingFilter() if smooth else None
        self._lag = lag
        self._previous = FIRST_LAGGED_REPLY

    def answer(self, body: bytes) -> bytes | Future[bytes]:
        """Answer one JSON request with one JSON reply. Never raises."""
        if _MARK not in body:
            return self._others(body)
        reply = self._service.handle_bytes(body, JSON, self._smoothing)
        if not self._lag:
            return reply
        reply, self._previous = self._previous, reply
        return reply
