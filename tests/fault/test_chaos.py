"""Service and operator are killed, stopped and restarted while the simulated robot moves: three real processes.

Hazard rows: service crash, service restart, lost connection, loop overrun, deadman release, weight ramp / exit. The
long run is `python benchmarks/chaos.py`.
"""

from pathlib import Path

import pytest

from benchmarks.faults.audit import audit
from benchmarks.faults.plan import Fault, Kind, Victim
from benchmarks.faults.trace import grips
from benchmarks.faults.world import World


@pytest.fixture
def compiled(kernel_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IK_CACHE_DIR", str(kernel_cache))


@pytest.mark.usefixtures("compiled")
def test_whatever_breaks_nothing_jumps_sags_or_moves_without_a_grip(tmp_path: Path) -> None:
    faults = [
        Fault(Victim.SERVICE, Kind.STOP, 0.4, 0.2),
        Fault(Victim.OPERATOR, Kind.STOP, 0.1, 1.0),
        Fault(Victim.OPERATOR, Kind.KILL, 0.4),
        Fault(Victim.SERVICE, Kind.KILL, 0.4),
    ]
    with World(tmp_path) as world:
        done = world.run(faults)
        trace, exits = world.end()
        found = audit(trace, done, grips(world.diary.entries))
    assert found.violations == []
    assert exits == []
    assert found.recovered == len(faults)
    assert found.disarming == 3
    assert found.engagements >= 4
    assert found.velocity > 0.2
    # SIGTERM at the end: the operator has given the arms back.
    assert trace.state[-1] == "released"
    assert trace.weight[-1] == 0.0
    assert (trace.weight[trace.state == "releasing"] > 0.0).any()
