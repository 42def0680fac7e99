"""The command `benchmarks/fuzz_decoders.py`: what it says and how it ends."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks import fuzz_decoders
from benchmarks.fuzz import live
from benchmarks.fuzz.run import Outcome


def test_an_unknown_target_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        fuzz_decoders.main(["--only", "json-requests,yaml"])
    assert ended.value.code == 2
    assert "there is no target yaml, there are json-requests" in capsys.readouterr().err


def test_a_broken_contract_is_shown_with_its_input() -> None:
    good = Outcome(1000, 2.0, 300, 1.5, {"refused: bad_request": 999, "accepted: SolveRequest": 1})
    bad = Outcome(7, 0.1, 40, 0.2, {}, Path("/tmp/crash-1"), "KeyError: [q]")
    text = io.StringIO()
    fuzz_decoders.show({"json-requests": good, "msgpack-requests": bad}, Console(file=text, width=140))
    said = text.getvalue()
    for part in ("500", "999", "msgpack-requests: the contract is broken", "/tmp/crash-1", "KeyError: [q]"):
        assert part in said
    assert "json-requests: the contract" not in said


@pytest.mark.slow
def test_a_good_client_is_measured_beside_a_hostile_one(
    monkeypatch: pytest.MonkeyPatch, kernel_cache: Path, tmp_path: Path
) -> None:
    monkeypatch.setenv("IK_CACHE_DIR", str(kernel_cache))
    monkeypatch.setattr(live, "TURN_S", 0.3)
    (tmp_path / "frame").write_bytes(b"\xff\xff\xff\xff")
    result = live.measure(2, 1, tmp_path)
    alone, *hostile = result["turns"].values()
    assert [len(turns) for turns in (alone, *hostile)] == [2, 2, 2]
    assert all(turn["hostile"] == 0 for turn in alone)
    assert all(turn["hostile"] > 10 for turns in hostile for turn in turns)
    assert all(0.0 < turn["p50"] <= turn["p99"] <= turn["max"] for turns in (alone, *hostile) for turn in turns)
    text = io.StringIO()
    live.show(result, Console(file=text, width=140))
    assert "beside a hostile flood" in text.getvalue()
