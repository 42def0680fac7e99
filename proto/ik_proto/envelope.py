"""The envelope: the fields every request may carry that say how to treat it, not what is asked.

- `token` is shown to a service that demands one.
- `stream` names requests of which only the newest matters: of those that wait at the same time the older are answered
  `superseded` instead of being solved. Requests without it are independent of each other.
- `budget_ms` is how long the answer is worth having, from the request's arrival on; past it the request is answered
  `expired` instead of being solved. It is relative, so nobody's clocks are compared.

A request in OpenWBT's form has none of them: its other keys are its own business.
"""

from dataclasses import dataclass

from ik_proto.fields import read_number, read_text
from ik_proto.limits import MAX_BUDGET_MS, MAX_STREAM_CHARACTERS, OPENWBT_MARK
from ik_proto.messages import Document

ENVELOPE_FIELDS = frozenset({"token", "stream", "budget_ms"})


@dataclass(frozen=True, slots=True)
class Envelope:
    """How a request wants to be treated.

    Attributes:
        token: The secret; empty for none.
        stream: Name of the stream of requests it belongs to; empty for none.
        budget_ms: How long its answer is worth having [ms]; None for ever.
    """

    token: str = ""
    stream: str = ""
    budget_ms: float | None = None


EMPTY = Envelope()


def read_envelope(document: Document) -> Envelope:
    """Read the envelope of a decoded request.

    Args:
        document: The request, unchanged.

    Returns:
        Its envelope; absent and null fields have their defaults.

    Raises:
        ValueError: A field is of the wrong type or out of its range.
    """
    if OPENWBT_MARK in document and document.get("verb", "solve") == "solve":
        return EMPTY
    stream = read_text(document, "stream", "")
    if len(stream) > MAX_STREAM_CHARACTERS:
        raise ValueError(f"stream must have at most {MAX_STREAM_CHARACTERS} characters, not {len(stream)}")
    return Envelope(read_text(document, "token", ""), stream, _read_budget(document))


def _read_budget(document: Document) -> float | None:
    if document.get("budget_ms") is None:
        return None
    budget = read_number(document, "budget_ms")
    if not 0.0 < budget <= MAX_BUDGET_MS:
        raise ValueError(f"budget_ms must be above 0 and at most {MAX_BUDGET_MS:g}")
    return budget
