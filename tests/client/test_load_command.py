"""`ik-load` as a person runs it: a process, its exit status, its words and its JSON."""

import json
import signal
import subprocess
import sys
import threading
from io import StringIO

import jsonschema
import pytest
from rich.console import Console

from ik_client.load.cli import main
from ik_client.load.outcomes import Outcomes
from ik_client.load.report import print_report
from ik_client.load.runner import LoadOptions, LoadResult
from ik_proto import InfoRequest, SolveRequest, Status

COUNT = {"type": "integer", "minimum": 0}
SECONDS = {"type": "number", "minimum": 0}
COUNTS = {"type": "object", "additionalProperties": COUNT}


def closed_object(**properties: object) -> dict:
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


DURATIONS = closed_object(**{"count": COUNT} | dict.fromkeys(("p50", "p90", "p99", "p99.9", "max"), SECONDS))
STRING = {"type": "string"}
SCHEMA = closed_object(
    tool={"const": "ik-load"},
    command={"type": "array", "items": {"type": "string"}},
    finished={"type": "string"},
    options=closed_object(
        url={"type": "string"},
        rate={"type": ["number", "null"]},
        duration=SECONDS,
        clients=COUNT,
        closed={"type": "boolean"},
        workload={"type": "string"},
        seed={"type": "integer"},
        timeout=SECONDS,
        warmup=SECONDS,
        preset={"type": ["string", "null"]},
        mode={"enum": ["track", "reach", None]},
        collision={"enum": ["off", "report", "avoid", None]},
        access=closed_object(**dict.fromkeys(("token_file", "ca", "cert", "key", "zenoh_config"), STRING)),
    ),
    service=closed_object(
        protocol=COUNT,
        **{name: {"type": "string"} for name in ("robot", "version", "kernel", "preset", "model_hash", "boot_id")},
    ),
    machine=closed_object(cpu={"type": "string"}, cores=COUNT, system={"type": "string"}),
    versions={"type": "object", "additionalProperties": {"type": "string"}, "required": ["python", "ik-service"]},
    interrupted={"type": "boolean"},
    measured_s=SECONDS,
    requests=closed_object(
        **dict.fromkeys(("due", "answered", "good", "timeouts", "unsent"), COUNT), statuses=COUNTS, errors=COUNTS
    ),
    rates_hz=closed_object(asked={"type": ["number", "null"]}, answered=SECONDS, good=SECONDS),
    latency_s=DURATIONS,
    round_trip_s=DURATIONS,
    solve_s=DURATIONS,
    generator=closed_object(
        lateness_s=DURATIONS, lateness_limit_s={"type": ["number", "null"]}, honest={"type": "boolean"}
    ),
)


@pytest.fixture
def fake(service, start_tcp):
    return start_tcp(service)


def ik_load(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "ik_client.load", *arguments], capture_output=True, text=True, timeout=60, check=False
    )


def test_a_run_reports_and_exits_0(fake, tmp_path):
    file = tmp_path / "load.json"
    run = ik_load(fake.url, "--rate", "40", "--duration", "1", "--clients", "2", "--warmup", "0.2", "--json", str(file))
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    for word in ("p50", "p99.9", "latency", "round trip", "generator lateness", "2 x 40 Hz, open loop, tracking"):
        assert word in run.stdout
    document = json.loads(file.read_text())
    jsonschema.validate(document, SCHEMA)
    assert document["command"][:2] == ["ik-load", fake.url]
    assert document["service"]["robot"] == "fake"
    requests = document["requests"]
    assert requests["due"] == requests["answered"] == requests["statuses"]["ok"]
    assert requests["due"] == pytest.approx(80, abs=2)  # whether a request at an edge counts is a matter of rounding
    assert document["latency_s"]["count"] == requests["due"]
    assert document["rates_hz"]["asked"] == 80.0


def test_failures_are_counted_and_exit_1(fake, service, tmp_path):
    answered = threading.Event()

    def answer(request):
        if hasattr(request, "left_wrist") and not answered.is_set():
            answered.set()
            return service.refuse(request, Status.INTERNAL)
        return service.reply(request)

    service.answer = answer
    file = tmp_path / "load.json"
    run = ik_load(fake.url, "--duration", "0.5", "--warmup", "0", "--json", str(file))
    assert run.returncode == 1
    assert json.loads(file.read_text())["requests"]["errors"] == {"internal": 1}
    assert "1 internal" in run.stdout


@pytest.mark.parametrize(
    "arguments", [["--workload", "random"], ["--workload", "unreachable", "--closed", "--rate", "30"]]
)
def test_other_workloads_and_a_closed_loop(fake, tmp_path, arguments):
    file = tmp_path / "load.json"
    run = ik_load(fake.url, "--duration", "0.3", "--warmup", "0.1", "--json", str(file), *arguments)
    assert run.returncode == 0, run.stderr
    jsonschema.validate(json.loads(file.read_text()), SCHEMA)


def test_preset_mode_and_collision_are_asked_for_and_reported(fake, service, tmp_path):
    file = tmp_path / "load.json"
    options = ["--preset", "openwbt", "--mode", "reach", "--collision", "off"]
    run = ik_load(fake.url, "--duration", "0.3", "--warmup", "0", "--json", str(file), *options)
    assert run.returncode == 0, run.stderr
    document = json.loads(file.read_text())
    jsonschema.validate(document, SCHEMA)
    assert document["service"]["preset"] == "openwbt"
    assert [document["options"][name] for name in ("preset", "mode", "collision")] == ["openwbt", "reach", "off"]
    assert "preset openwbt, reach, collision off, service" in run.stdout
    solves = [request for request in service.requests if isinstance(request, SolveRequest)]
    assert len(solves) > 5
    assert {(request.preset, request.mode, request.collision) for request in solves} == {("openwbt", "reach", "off")}


def test_as_fast_as_answered(fake, tmp_path):
    file = tmp_path / "load.json"
    run = ik_load(fake.url, "--closed", "--duration", "0.3", "--json", str(file))
    assert run.returncode == 0, run.stderr
    document = json.loads(file.read_text())
    assert document["rates_hz"]["asked"] is None
    assert document["generator"]["lateness_limit_s"] is None
    assert "as fast as answered, closed loop" in run.stdout


def test_ctrl_c_ends_it_and_prints_what_was_measured(fake, service, tmp_path):
    file = tmp_path / "load.json"
    under_way = threading.Event()

    def answer(request):
        if len(service.requests) > 2100:  # 2000 of them asked for the workload
            under_way.set()
        return service.reply(request)

    service.answer = answer
    command = [sys.executable, "-m", "ik_client.load", fake.url, "--duration", "3600", "--warmup", "0"]
    with subprocess.Popen([*command, "--json", str(file)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert under_way.wait(60.0)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert err == b""
    assert b"Interrupted" in out
    document = json.loads(file.read_text())
    jsonschema.validate(document, SCHEMA)
    assert document["interrupted"] is True
    assert 0 < document["requests"]["answered"] < 50 * 3600


def test_nobody_there_is_one_line_and_exits_2(free_port):
    run = ik_load(f"tcp://127.0.0.1:{free_port}", "--duration", "1")
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert f"ik-service serve --tcp 127.0.0.1:{free_port}" in run.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ftp://127.0.0.1:1"], "is no address of a service"),
        (["tcp://127.0.0.1:1", "--json", "/"], "/ is a folder"),
        (["tcp://127.0.0.1:1", "--json", "/no/such/folder/load.json"], "choose an existing folder"),
    ],
)
def test_a_mistake_is_one_line_and_exits_2(capsys, arguments, message):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["tcp://127.0.0.1:1", "--rate", "0"],
        ["tcp://127.0.0.1:1", "--rate", "fast"],
        ["tcp://127.0.0.1:1", "--clients", "1.5"],
        ["tcp://127.0.0.1:1", "--warmup", "-1"],
        ["tcp://127.0.0.1:1", "--duration", "inf"],
        ["tcp://127.0.0.1:1", "--workload", "hard"],
        ["tcp://127.0.0.1:1", "--mode", "walk"],
        ["tcp://127.0.0.1:1", "--collision", "on"],
    ],
)
def test_wrong_arguments_exit_2(capsys, arguments):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "ik-load: error:" in capsys.readouterr().err


def test_a_missing_package_is_one_line_that_names_the_extra():
    program = (
        "import sys; sys.modules['hdrh'] = None; from ik_client.load.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, "tcp://127.0.0.1:1"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "pip install 'ik-service[load]'" in run.stderr


def test_a_late_generator_says_so(service):
    def printed(lateness: float, rate: float | None) -> str:
        outcomes = Outcomes()
        for _ in range(100):
            outcomes.lateness.record(lateness)
        options = LoadOptions("tcp://127.0.0.1:1", rate, 1.0, closed=rate is None)
        result = LoadResult(options, service.reply(InfoRequest()), outcomes, 1.0, interrupted=False)
        out = StringIO()
        print_report(result, Console(file=out))
        return out.getvalue()

    assert "Doubtful" not in printed(0.0019, 50.0)
    assert "Doubtful" in printed(0.0021, 50.0)
    assert "Doubtful" not in printed(10.0, None)


def test_a_frozen_service_shows_in_real_time(fake, service, tmp_path):
    """Over real sockets: one freeze of a quarter of the run delays what was due meanwhile, and nothing is left out."""
    solves = [0]

    def answer(request):
        if hasattr(request, "left_wrist"):
            solves[0] += 1
            if solves[0] == 20:
                threading.Event().wait(0.5)
        return service.reply(request)

    service.answer = answer
    file = tmp_path / "load.json"
    run = ik_load(fake.url, "--rate", "50", "--duration", "2", "--warmup", "0", "--timeout", "5", "--json", str(file))
    assert run.returncode == 0, run.stderr
    document = json.loads(file.read_text())
    assert document["requests"]["answered"] == 100
    # Every request due in the half second had to wait for its rest.
    assert document["latency_s"]["p90"] > 0.2
    assert document["round_trip_s"]["p90"] < document["latency_s"]["p90"]
    assert document["latency_s"]["max"] > 0.45
