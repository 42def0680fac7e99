"""Puts the tables of a saved run into a page: `python -m benchmarks.limits.page NUMBERS.json PAGE.md`.

They replace whatever is between the page's two marks.
"""

import sys
from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.marked_page import between, fill_page

BEGIN, END = "<!-- limits: begin -->", "<!-- limits: end -->"

VERDICTS = {None: "", True: "met", False: "**missed**"}


def tables(numbers: Mapping[str, Any]) -> str:
    """The tables of all measurements, and what the numbers depend on."""
    machine = numbers["environment"]
    kernel = {"c": "generated C", "vm": "virtual machine"}[numbers["kernel"]]
    parts = [
        f"Measured {machine['when'][:10]} on {machine['cpu']}, {machine['cores']} cores, Python {machine['python']}, "
        f"{kernel}; load {machine['load']:.1f} at the end."
    ]
    for result in numbers["results"].values():
        title = result["title"][0].upper() + result["title"][1:]
        parts += [f"### {title}", "\n".join(_table(result["rows"]))]
    return "\n\n".join(parts)


def fill(page: str, numbers: Mapping[str, Any]) -> str:
    """The page with the tables between its marks.

    Args:
        page: Text with both marks.
        numbers: A saved run.

    Returns:
        The new text.

    Raises:
        ValueError: A mark is missing.
    """
    return between(page, BEGIN, END, lambda: tables(numbers))


def _table(rows: list[Mapping[str, Any]]) -> Iterator[str]:
    yield "| what | asked | measured | |"
    yield "| --- | ---: | --- | --- |"
    for row in rows:
        yield f"| {row['what']} | {row['asked']} | {row['measured']} | {VERDICTS[row['met']]} |"


if __name__ == "__main__":
    sys.exit(fill_page(fill))
