"""Batch requests: N problems in arrays with a leading N, read and checked whole.

A batch is accepted when each of its rows would be; the first bad row is named with its field, as in `left_wrist[17]`.
How many rows there are is what `q` says.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ik_proto.errors import RowError
from ik_proto.fields import ANY_FINITE, beyond, read_array, read_choice, read_id, read_integer, read_shaped, read_text
from ik_proto.hints import as_elbows, as_weight_rows
from ik_proto.limits import DEFAULT_STARTS, MAX_ABS_JOINT, MAX_BATCH, MAX_POSTURES, MAX_STARTS
from ik_proto.messages import COLLISIONS, MODES, Array, ClearanceRequest, Document, SolveBatchRequest
from ik_proto.pose import as_poses


def parse_postures(document: Document, n: int, n_waist: int) -> ClearanceRequest:
    """Validate a `clearance` whose field names are known to be right.

    Args:
        document: What a codec decoded.
        n: Number of arm joints of the robot served.
        n_waist: Number of its waist joints.

    Returns:
        A typed request.

    Raises:
        ValueError: Something is wrong with it; one line that names field and row.
    """
    k = _count_rows(document.get("q"), n, MAX_POSTURES)
    waist = document.get("waist")
    return ClearanceRequest(
        _read_bounded(document, "q", (k, n), MAX_ABS_JOINT),
        read_id(document),
        None if waist is None else read_array(document, "waist", (n_waist,), MAX_ABS_JOINT),
    )


def parse_batch(document: Document, n: int, n_waist: int) -> SolveBatchRequest:
    """Validate a `solve_batch` whose field names are known to be right.

    Args:
        document: What a codec decoded.
        n: Number of arm joints of the robot served.
        n_waist: Number of its waist joints.

    Returns:
        A typed request.

    Raises:
        ValueError: Something is wrong with it; one line that names field and row.
    """
    N = _count_rows(document.get("q"), n, MAX_BATCH)
    q = _read_bounded(document, "q", (N, n), MAX_ABS_JOINT)
    return SolveBatchRequest(
        left_wrist=_checked("left_wrist", as_poses, read_shaped(document, "left_wrist", (N, 4, 4))),
        right_wrist=_checked("right_wrist", as_poses, read_shaped(document, "right_wrist", (N, 4, 4))),
        q=q,
        dq=_read_optional(document, "dq", (N, n), MAX_ABS_JOINT),
        preset=read_text(document, "preset", "") or None,
        id=read_id(document),
        mode=read_choice(document, "mode", MODES, "track"),
        waist=_read_optional(document, "waist", (N, n_waist), MAX_ABS_JOINT),
        left_elbow=_read_optional(document, "left_elbow", (N, 4), check=as_elbows),
        right_elbow=_read_optional(document, "right_elbow", (N, 4), check=as_elbows),
        weights=_read_optional(document, "weights", (N, 2, 2), check=as_weight_rows),
        collision=read_choice(document, "collision", COLLISIONS, None),
        starts=read_integer(document, "starts", 1, MAX_STARTS, DEFAULT_STARTS),
    )


def _count_rows(q: Any, n: int, most: int) -> int:
    """How many rows there seem to be; whether they are rows is seen on reading them."""
    if isinstance(q, bytes):
        N = len(q) // max(8 * n, 1)
    elif isinstance(q, list | tuple | np.ndarray) and (not isinstance(q, np.ndarray) or q.ndim > 0):
        N = len(q)
        if N and isinstance(q[0], float | int):
            raise ValueError(f"q must have rows of {n}, even where there is only one")
    else:
        N = 1
    if not 1 <= N <= most:
        raise ValueError(f"q has {N} rows; 1 to {most} are accepted")
    return N


def _read_optional(
    document: Document,
    name: str,
    shape: tuple[int, ...],
    bound: float = ANY_FINITE,
    check: Callable[[Array], Array] = lambda rows: rows,
) -> Array | None:
    if document.get(name) is None:
        return None
    return _checked(name, check, _read_bounded(document, name, shape, bound))


def _read_bounded(document: Document, name: str, shape: tuple[int, ...], bound: float) -> Array:
    """Rows of finite numbers, each with a norm within the bound."""
    rows = read_shaped(document, name, shape)
    flat = rows.reshape(shape[0], math.prod(shape[1:]))
    with np.errstate(over="ignore", invalid="ignore"):
        good = np.sqrt(np.sum(flat * flat, axis=1)) <= bound  # written so that NaN fails
    if not good.all():
        row = int(np.argmin(good))
        raise ValueError(f"{name}[{row}] {beyond(flat[row], bound)}")
    return rows


def _checked(name: str, check: Callable[[Array], Array], rows: Array) -> Array:
    try:
        return check(rows)
    except RowError as error:
        raise ValueError(f"{name}[{error.row}] {error}") from None
