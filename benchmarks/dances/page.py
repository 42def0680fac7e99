"""Puts the tables of a saved run into a page: `python -m benchmarks.dances.page NUMBERS.json PAGE.md`.

They replace whatever is between the page's marks. What was not measured in that run stays as it is.
"""

import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.marked_page import between, fill_page

DANCES = "<!-- dances: begin -->", "<!-- dances: end -->"
BUDGET = "<!-- budget: begin -->", "<!-- budget: end -->"
REPLAYS = "<!-- replays: begin -->", "<!-- replays: end -->"
MISSED = "<!-- missed: begin -->", "<!-- missed: end -->"

BENT = "<!-- bent: begin -->", "<!-- bent: end -->"

CAUSES = ("late", "other bend", "in the way", "other arm", "moved", "asked")
"""Why upper arms are missed, as `tests/camera/missed.py` says."""
_KNOWN = ("known", "unknown")


def fill(page: str, numbers: Mapping[str, Any]) -> str:
    """The page with new tables."""
    if "dances" in numbers:
        page = between(page, *DANCES, lambda: "\n".join(_dances(numbers)))
        page = between(page, *BUDGET, lambda: "\n".join(_budget(numbers)))
    page = between(page, *REPLAYS, lambda: "\n".join(_replays(numbers)))
    page = between(page, *MISSED, lambda: "\n".join(_missed(numbers)))
    return between(page, *BENT, lambda: "\n".join(_bent(numbers)))


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
            "clear of itself [mm]",
            "answer's step [rad]",
            "possible",
            like,
            "elbow p95 [°]",
            "robot's elbow within",
        ],
        [
            [
                row["clip"],
                f"{row['seconds']:.0f}",
                f"{-row['beyond']:.3f}",
                f"{row['step']:.2f}",
                f"{1000.0 * row['clearance']:.1f}",
                f"{row['wanted_step']:.2f}",
                f"{row['possible']:.0%}",
                f"{row['elbow_like']:.1%}",
                f"{row['elbow_p95']:.1f}",
                _share(row["arms"], "robot", "judged"),
            ]
            for row in numbers["replays"]
        ],
    )


def _missed(numbers: Mapping[str, Any]) -> Iterator[str]:
    rows = [(row["clip"], row["arms"], row["causes"]) for row in numbers["replays"]]
    arms, causes = Counter(), Counter()
    for _, some, why in rows:
        arms.update(some)
        causes.update(why)
    heads = ["possible", "missed", *CAUSES, "in time", "of these, answer", "robot", "no speed limit", "onward, answer"]
    yield from _table(
        ["clip", *heads, "robot"],
        [
            [
                name,
                str(some["judged"]),
                str(some["judged"] - some["answer"]),
                *(str(why.get(cause, 0)) for cause in CAUSES),
                _share(some, "in_time", "judged"),
                _share(some, "answer_in_time", "in_time"),
                _share(some, "robot_in_time", "in_time"),
                *(_share(some, of, "judged") for of in ("unlimited", "onward_answer", "onward_robot")),
            ]
            for name, some, why in [*rows, ("all", arms, causes)]
        ],
    )


def _bent(numbers: Mapping[str, Any]) -> Iterator[str]:
    yield from _table(
        ["waist", "blocked, its bend known", "not known", "robot's elbow within, known", "not known"],
        [
            [row["waist"], *(f"{row[known][number]:.1%}" for number in ("blocked", "robot_like") for known in _KNOWN)]
            for row in numbers["bent"]
        ],
    )


def _share(arms: Mapping[str, int], some: str, of: str) -> str:
    return f"{arms[some] / arms[of]:.1%}" if arms[of] else ""


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
