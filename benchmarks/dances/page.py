"""Puts the tables of a saved run into a page: `python -m benchmarks.dances.page NUMBERS.json PAGE.md`.

They replace whatever is between the page's marks.
"""

import sys
from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.marked_page import between, fill_page

DANCES = "<!-- dances: begin -->", "<!-- dances: end -->"
BUDGET = "<!-- budget: begin -->", "<!-- budget: end -->"
REPLAYS = "<!-- replays: begin -->", "<!-- replays: end -->"


def fill(page: str, numbers: Mapping[str, Any]) -> str:
    """The page with new tables."""
    page = between(page, *DANCES, lambda: "\n".join(_dances(numbers)))
    page = between(page, *BUDGET, lambda: "\n".join(_budget(numbers)))
    return between(page, *REPLAYS, lambda: "\n".join(_replays(numbers)))


def _dances(numbers: Mapping[str, Any]) -> Iterator[str]:
    machine, asked = numbers["environment"], numbers["asked"]
    times = sorted(dance["milliseconds"] for dance in numbers["dances"])
    yield (
        f"Measured {machine['when'][:10]} on {machine['cpu']}, {machine['cores']} cores, load {machine['load']:.1f} at "
        f"the end. Noise seeds {', '.join(map(str, numbers['seeds']))}; each number is the worst of them. Everything "
        f"after the landmarks took {times[len(times) // 2]:.2f} ms a frame (median)."
    )
    yield ""
    yield from _table(
        ["body", "dance", "chain", *(f"{words} [{unit}]" if unit else words for *_, words, unit in asked.values())],
        [
            [
                dance["body"],
                dance["dance"],
                name,
                *(_number(scale * dance["worst"][chain][key], limit) for key, (scale, limit, *_) in asked.items()),
            ]
            for dance in numbers["dances"]
            for chain, name in numbers["names"].items()
        ]
        + [["", "", "asked at most", *(f"{limit:g}" for _, limit, *_ in asked.values())]],
    )


def _budget(numbers: Mapping[str, Any]) -> Iterator[str]:
    asked, budget = numbers["asked"], numbers["budget"]
    shown = ("wrist_mean", "wrist_p95", "turn_p95", "jitter")
    yield from _table(
        [f"{budget['body']}, full dance", *(f"{asked[key][2]} [{asked[key][3]}]" for key in shown)],
        [
            [name, *(_number(asked[key][0] * score[key], asked[key][1]) for key in shown)]
            for name, score in budget["scores"].items()
        ],
    )


def _replays(numbers: Mapping[str, Any]) -> Iterator[str]:
    like = f"elbow within {numbers['elbow_like']:g}°"
    yield from _table(
        [
            "clip",
            "s",
            "nearest to a limit [rad]",
            "fastest [rad/s]",
            "answer's step [rad]",
            "possible",
            like,
            "elbow p95 [°]",
        ],
        [
            [
                row["clip"],
                f"{row['seconds']:.0f}",
                f"{-row['beyond']:.3f}",
                f"{row['step']:.2f}",
                f"{row['wanted_step']:.2f}",
                f"{row['possible']:.0%}",
                f"{row['elbow_like']:.1%}",
                f"{row['elbow_p95']:.1f}",
            ]
            for row in numbers["replays"]
        ],
    )


def _table(heads: list[str], rows: list[list[str]]) -> Iterator[str]:
    yield f"| {' | '.join(heads)} |"
    words = sum(not cell.replace(".", "").lstrip("-").isdigit() for cell in rows[0])
    yield f"|{'---|' * min(words, 3)}{'---:|' * (len(heads) - min(words, 3))}"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _number(value: float, limit: float) -> str:
    return f"{value:.{0 if limit == 0 else 1}f}"


if __name__ == "__main__":
    sys.exit(fill_page(fill))
