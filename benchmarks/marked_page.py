"""Puts generated text between two marks of a page, and what was there before out of it."""

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any


def between(page: str, begin: str, end: str, text: Callable[[], str]) -> str:
    """Replace what stands between two marks.

    Args:
        page: Text with both marks.
        begin: The first mark.
        end: The second mark.
        text: Makes what is to stand between them; not called for a page without them.

    Returns:
        The new text.

    Raises:
        ValueError: A mark is missing.
    """
    before, found_begin, rest = page.partition(begin)
    _, found_end, after = rest.partition(end)
    if not (found_begin and found_end):
        raise ValueError(f"the page needs the marks {begin} and {end}")
    return f"{before}{begin}\n\n{text()}\n\n{end}{after}"


def fill_page(fill: Callable[[str, Mapping[str, Any]], str]) -> int:
    """Fill the page named on the command line, after the file of numbers; return the exit code."""
    numbers, page = Path(sys.argv[1]), Path(sys.argv[2])
    text = fill(page.read_text(encoding="utf-8"), json.loads(numbers.read_text(encoding="utf-8")))
    page.write_text(text, encoding="utf-8")
    return 0
