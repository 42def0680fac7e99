"""The page of hazards: all of them are there, and each names tests that exist and say so themselves."""

import ast
import re
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
PAGE = (REPO / "docs" / "safety.md").read_text(encoding="utf-8")
HAZARDS = (
    "stale target",
    "lost connection",
    "NaN / Inf",
    "non-orthonormal / reflected",
    "teleporting target",
    "first frame / re-clutch",
    "unreachable",
    "solver failure",
    "singularity",
    "self-collision",
    "joint limits",
    "velocity / acceleration / jerk",
    "service crash",
    "service restart",
    "duplicate services",
    "two operators",
    "clock skew",
    "replay / reorder",
    "oversized frame",
    "malformed frame",
    "slowloris / flood",
    "auth",
    "deadman release",
    "stop path broken",
    "weight ramp / exit",
    "torque limits",
    "loop overrun",
    "rocking body",
    "stale torque",
    "caught arm",
    "switch gone",
    "covered limb",
    "passer-by",
    "homing",
)
DOCUMENTED_ONLY = "torque limits"


def rows() -> dict[str, list[str]]:
    """Hazard to the tests its row names."""
    table = PAGE[PAGE.index("| hazard |") :].split("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    return {cell[0]: re.findall(r"`(test_\w+::test_\w+)`", cell[2]) for cell in cells}


def docstrings() -> dict[str, str]:
    """Test to what it and its file say of themselves."""
    found = {}
    for file in (REPO / "tests").rglob("test_*.py"):
        module = ast.parse(file.read_text(encoding="utf-8"))
        for node in ast.walk(module):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                said = f"{ast.get_docstring(node) or ''} {ast.get_docstring(module) or ''}"
                found[f"{file.stem}::{node.name}"] = " ".join(said.split())
    return found


def test_every_hazard_has_its_row() -> None:
    assert tuple(rows()) == HAZARDS
    assert len(HAZARDS) == 34


@pytest.mark.parametrize("hazard", [hazard for hazard in HAZARDS if hazard != DOCUMENTED_ONLY])
def test_a_row_names_tests_that_name_the_row(hazard: str) -> None:
    tests, known = rows()[hazard], docstrings()
    assert tests
    for test in tests:
        assert test in known, f"there is no {test}"
        words = known[test]
        assert "hazard" in words.lower(), f"{test} names no hazard"
        # A row with two names is named by either.
        assert any(name in words for name in (hazard, *hazard.split(" / "))), (
            f"{test} does not name {hazard!r}: {words}"
        )


def test_what_is_not_handled_is_said() -> None:
    assert "not handled here" in PAGE
    assert "Torque is not limited here" in (REPO / "README.md").read_text(encoding="utf-8")
