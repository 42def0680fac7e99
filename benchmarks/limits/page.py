"""Puts the tables of a saved run into a page: `python -m benchmarks.limits.page NUMBERS.json PAGE.md`.

They replace whatever is between the page's two marks.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

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
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the page needs the marks {BEGIN} and {END}")
    return f"{before}{BEGIN}\n\n{tables(numbers)}\n\n{END}{after}"


def _table(rows: list[Mapping[str, Any]]) -> Iterator[str]:
    yield "| what | asked | measured | |"
    yield "| --- | ---: | --- | --- |"
    for row in rows:
        yield f"| {row['what']} | {row['asked']} | {row['measured']} | {VERDICTS[row['met']]} |"


def main() -> int:
    """Fill a page."""
    numbers, page = Path(sys.argv[1]), Path(sys.argv[2])
    text = fill(page.read_text(encoding="utf-8"), json.loads(numbers.read_text(encoding="utf-8")))
    page.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
