"""Reports: the numbers are those of the trace, the JSON is complete, and a terminal shows all of it."""

import json
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from rich.live import Live
from sim_fakes import steps_to

from ik_client import Command, LoopState, TickReport
from ik_proto import SolveReply, Status
from sim_client.events import Announcer
from sim_client.live import LiveTable
from sim_client.poses import rotation_about
from sim_client.realtime import Pace
from sim_client.report import RunReport, report_lines, report_table, spread, summarise
from sim_client.trace import Tick, Trace

BOOT = "run one"


def make_tick(index: int, *, off: float = 0.0, turned: float = 0.0, hold: str = "", boot_id: str = BOOT) -> Tick:
    """A tick whose left wrist is off its target by a distance [m], and whose right one by an angle [rad]."""
    target, turned_target = np.eye(4), np.eye(4)
    left = np.eye(4)
    left[0, 3] = off
    turned_target[:3, :3] = rotation_about(np.array([0.0, turned, 0.0]))
    reply = SolveReply(
        success=True,
        error="",
        status=Status.OK,
        boot_id=boot_id,
        position_error=np.array([0.001, 0.003]),
        rotation_error=np.zeros(2),
        solve_us=100.0 + index,
    )
    report = TickReport(
        time=100.0 + 0.02 * index,
        state=LoopState.HOLDING if hold else LoopState.TRACKING,
        reason=hold,
        command=Command(np.full(4, 0.01 * index), np.zeros(4), 0.0),
        arms=steps_to(target, turned_target),
        reply=None if hold else reply,
        round_trip=0.002,
    )
    return Tick(index, 0.02 * (index + 1), report, np.zeros(5), (left, np.eye(4)), 0.0, 0.003)


def traced(ticks: list[Tick]) -> Trace:
    trace = Trace()
    for tick in ticks:
        trace.observe(tick)
    return trace


@pytest.fixture
def report() -> RunReport:
    ticks = [make_tick(i, off=0.001 * i, turned=0.1) for i in range(101)]
    ticks += [make_tick(i, off=5.0, hold="nobody [is] there") for i in range(101, 111)]
    pace = Pace(ticks=111, simulated=2.22, elapsed=2.2, busy=0.37, late_ticks=3, moved=1)
    return summarise(traced(ticks), pace, ticks_without_command=2, events=["a", "b"], settings={"path": "circles"})


def test_spread_is_that_of_numpy() -> None:
    values = np.random.default_rng(0).exponential(size=1000)
    result = spread(values)
    assert result is not None
    assert (result.count, result.max) == (1000, values.max())
    assert [result.p50, result.p95, result.p99] == pytest.approx(np.percentile(values, [50, 95, 99]))
    assert spread([]) is None


def test_numbers_are_those_of_the_trace(report: RunReport) -> None:
    left, right = report.wrist_error_mm["left"], report.wrist_error_deg["right"]
    assert left is not None
    assert right is not None
    # While following only: the ten held ticks, 5 m off, do not count.
    assert (left.count, left.p50, left.max) == (101, pytest.approx(50.0), pytest.approx(100.0))
    assert right.p50 == pytest.approx(np.degrees(0.1))
    answer = report.answer_error_mm["right"]
    assert answer is not None
    assert answer.p50 == pytest.approx(3.0)
    assert (report.tracking_ticks, report.holding_ticks) == (101, 10)
    assert report.hold_reasons == {"nobody [is] there": 10}
    assert report.statuses == {"ok": 101}
    assert report.largest_step == pytest.approx(0.01)
    assert report.ticks_without_command == 2
    assert report.real_time_factor == pytest.approx(2.22 / 2.2)
    assert report.headroom == pytest.approx(6.0)
    assert report.round_trip_ms is not None
    assert report.round_trip_ms.count == 101
    assert report.round_trip_ms.p50 == pytest.approx(2.0)
    assert report.solve_us is not None
    assert report.solve_us.max == 200.0


def test_an_empty_run_has_a_report() -> None:
    pace = Pace(ticks=0, simulated=0.0, elapsed=0.0, busy=0.0, late_ticks=0, moved=0)
    report = summarise(Trace(), pace, ticks_without_command=0, events=[], settings={})
    assert report.largest_step == 0.0
    assert report.wrist_error_mm == {"left": None, "right": None}
    assert shown(report)


def test_json_has_every_field(report: RunReport, tmp_path: Path) -> None:
    path = tmp_path / "new" / "report.json"
    report.write(path)
    document = json.loads(path.read_text())
    assert set(document) == set(report.__dataclass_fields__)
    assert document["wrist_error_mm"]["left"]["p50"] == pytest.approx(50.0)
    assert document["machine"]["mujoco"]
    assert document["settings"] == {"path": "circles"}


def shown(report: RunReport) -> str:
    console = Console(file=StringIO(), width=120)
    console.print(report_table(report))
    for line in report_lines(report):
        console.print(line, markup=False)
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_a_terminal_shows_units_and_reasons(report: RunReport) -> None:
    text = shown(report)
    for part in ("left wrist off target [mm]", "[deg]", "solve in the service [us]", "50.0", "nobody [is] there"):
        assert part in text
    assert "2 ticks without a command" in text
    assert "3 of 111 ticks late" in text
    assert "\x1b" not in text


def test_a_change_is_announced_once() -> None:
    said: list[str] = []
    announcer = Announcer(said.append)
    ticks = [make_tick(i) for i in range(3)]
    ticks += [make_tick(i, hold="nobody there") for i in range(3, 9)]
    ticks += [make_tick(9, hold="still nobody")]
    ticks += [make_tick(i, boot_id="run two") for i in range(10, 13)]
    for tick in ticks:
        announcer.observe(tick)
    assert [line.split("s  ", 1)[1] for line in said] == [
        "holding the last command: nobody there",
        "following after 0.14 s",
        "the service was restarted",
    ]
    assert announcer.lines == said


def test_a_restart_before_the_first_tick_is_announced() -> None:
    said: list[str] = []
    announcer = Announcer(said.append, boot_id="run zero")
    announcer.observe(make_tick(0))
    assert [line.split("s  ", 1)[1] for line in said] == ["the service was restarted"]


def test_a_quiet_run_says_nothing() -> None:
    said: list[str] = []
    announcer = Announcer(said.append)
    for i in range(5):
        announcer.observe(make_tick(i))
    assert said == []


def test_the_trace_forgets_its_beginning() -> None:
    trace = Trace(kept=10)
    for i in range(25):
        trace.observe(make_tick(i))
    assert [tick.index for tick in trace] == list(range(15, 25))


def test_the_live_table_shows_what_is_going_on() -> None:
    console = Console(file=StringIO(), width=100, force_terminal=True, color_system=None)
    with Live(console=console, auto_refresh=False) as live:
        table = LiveTable(live, clock=lambda: 100.0 + 0.02 * 25)
        for i in range(25):
            table.observe(make_tick(i, off=0.012, hold="nobody [there]" if i == 24 else ""))
    assert isinstance(console.file, StringIO)
    text = console.file.getvalue()
    for part in ("holding: nobody [there]", "left wrist off target [mm]", "12.0", "real-time factor", "1.000"):
        assert part in text
