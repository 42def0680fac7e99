"""What callers pass: how long it is, and whether the service would accept a request made of it."""

from collections.abc import Sequence, Sized

import numpy as np

from ik_client.errors import BadRequest
from ik_proto import Document, RequestError, parse_request, request_document


def size(vector: object) -> int:
    """Length of what may be a vector; 0 where it is none."""
    try:
        return len(vector) if isinstance(vector, Sized) else 0
    except TypeError:  # an array of no dimension
        return 0


def width(rows: object) -> int:
    """Length of the first row of what may be a matrix; 0 where it is none."""
    return size(rows[0]) if isinstance(rows, Sequence | np.ndarray) and size(rows) else 0


def validated(document: Document, n: int, n_waist: int) -> Document:
    """The document of a request the service would accept.

    Args:
        document: The request as the caller made it.
        n: Number of arm joints.
        n_waist: Number of waist joints.

    Returns:
        A new document.

    Raises:
        BadRequest: The service would refuse it.
    """
    try:
        return request_document(parse_request(document, n, n_waist))
    except RequestError as error:
        raise BadRequest(error.status, str(error)) from None


def check_times(timeout: float, connect_timeout: float, budget: float | None, longest_budget: float) -> None:
    """Refuse time limits that make no sense.

    Args:
        timeout: How long a call may take [s].
        connect_timeout: How long connecting may take [s].
        budget: How long an answer is worth having [s]; None for as long as the call may take.
        longest_budget: The most the contract allows [s].

    Raises:
        ValueError: One of them is not positive, not finite or too long.
    """
    for name, value in (("timeout", timeout), ("connect_timeout", connect_timeout)):
        if not 0.0 < value < float("inf"):
            raise ValueError(f"{name} must be a positive number of seconds, not {value}")
    if budget is not None and not 0.0 < budget <= longest_budget:
        raise ValueError(f"budget must be above 0 s and at most {longest_budget:g} s, not {budget}")
