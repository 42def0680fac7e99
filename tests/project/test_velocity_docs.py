"""The page on velocities names every parameter, and its numbers are those of the code."""

import re
from pathlib import Path

import pytest

from ik_proto import limits
from ik_proto.messages import LIMITS
from ik_proto.velocities import FIELDS, NUMBERS

REPO = Path(__file__).resolve().parents[2]
PAGE = (REPO / "docs" / "velocity.md").read_text()


def table(heading: str) -> dict[str, list[str]]:
    """Cells of the first table of a section, by each name in the first."""
    section = PAGE.split(f"## {heading}\n")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in re.findall(r"^\|.*\|$", section, re.M)]
    return {name: row[1:] for row in rows[2:] for name in re.findall(r"`([^`]+)`", row[0])}


def test_every_parameter_is_told() -> None:
    assert set(table("Parameters")) == FIELDS


@pytest.mark.parametrize("name", NUMBERS)
def test_defaults_and_ranges_are_those_of_the_code(name: str) -> None:
    default, low, high = NUMBERS[name]
    _, told, reach, _ = table("Parameters")[name]
    assert float(told) == default
    assert reach == f"{low:g} to {high:,.0f}"


def test_every_limit_is_told() -> None:
    assert set(table("What limits, and how it is said")) == {name or '""' for name in LIMITS}


def test_numbers_in_the_text_are_those_of_the_code() -> None:
    assert f"below {limits.SINGULAR_TWIST:g} with the orientation held, {limits.SINGULAR_LINEAR:g} with it free" in PAGE
    assert f"norm at most {limits.MAX_TWIST:g}" in table("Parameters")["left_twist"][2]
