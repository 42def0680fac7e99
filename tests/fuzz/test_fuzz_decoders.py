"""A bounded run of the coverage-guided fuzzer, with one seed; the full one is `benchmarks/fuzz_decoders.py`.

Hazard row: malformed frame.
"""

import textwrap
from pathlib import Path

import pytest
import umsgpack

from benchmarks.fuzz.run import fuzz
from benchmarks.fuzz.workbench import TARGETS

pytest.importorskip("atheris", reason="coverage-guided fuzzing needs atheris: pip install atheris")

FRAMES = {"requests": 4000, "replies": 3000}


@pytest.mark.parametrize("name", TARGETS)
def test_every_frame_is_accepted_or_refused_by_a_documented_error(name: str, tmp_path: Path) -> None:
    side = TARGETS[name][1]
    outcome = fuzz(name, FRAMES[side], tmp_path, kernel="vm")
    assert outcome.fault == "", outcome.culprit
    assert outcome.frames >= FRAMES[side]
    # The mutations get past the first check, and do not all get past the last.
    kinds = outcome.counts.keys()
    assert {"refused: cannot be decoded"} < kinds
    if side == "requests":
        accepted = {f"accepted: {kind}Request" for kind in ("Solve", "SolveBatch", "Fk", "Info")}
        assert accepted | {"answered: ok", "answered: bad_request", "refused: unsupported"} <= kinds
    else:
        assert {f"accepted: {kind}Reply" for kind in ("Solve", "Batch", "Fk", "Info")} <= kinds


def test_a_fault_that_hides_behind_the_structure_is_found_and_kept(tmp_path: Path) -> None:
    """Without this a fuzzer that runs nothing would pass the tests above."""
    plant = """
        import msgpack

        unpack = msgpack.unpackb

        def faulty(body, **options):
            document = unpack(body, **options)
            if isinstance(document, dict) and document.get("status") == "blocked" and "nearest" not in document:
                raise KeyError("planted")
            return document

        msgpack.unpackb = faulty
    """
    (tmp_path / "sitecustomize.py").write_text(textwrap.dedent(plant))
    outcome = fuzz("msgpack-replies", 100_000, tmp_path / "run", environment={"PYTHONPATH": str(tmp_path)})
    assert "KeyError: 'planted'" in outcome.fault
    assert outcome.culprit is not None
    assert umsgpack.unpackb(outcome.culprit.read_bytes())["status"] == "blocked"
