"""Batches: a bad row is found on whole arrays, and named in the words of the check of a single one."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ik_proto.errors import RowError
from ik_proto.messages import Array


def require_rows(good: NDArray[np.bool_], rows: Array, check: Callable[[Array], object]) -> None:
    """Raise for the first row that is not good.

    Args:
        good: Which rows are, shape (N,).
        rows: The rows, N of them.
        check: Raises ValueError, with the reason, for a row that is not good.

    Raises:
        RowError: The first such row, and why.
    """
    if good.all():
        return
    row = int(np.argmin(good))
    try:
        check(rows[row])
    except ValueError as error:
        raise RowError(row, str(error)) from None
    raise AssertionError(f"row {row} is good alone and bad in a batch")
