"""`ik-sim` as a person runs it: a process of its own against a real service in another."""

import json
import os
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from sim_client.cli import EXIT_USAGE, main
from sim_client.extras import missing_extra
from sim_client.robot import CONTROL_PERIOD
from sim_client.settings import MAX_VELOCITY, Settings, SettingsError

LIMIT = 60.0
"""How long any single thing may take before the test gives up [s]."""

HANG = 0.5
"""How long a service is suspended [s]."""


class SimProcess:
    """A running `ik-sim --headless`."""

    def __init__(self, *arguments: str) -> None:
        environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sim_client", *arguments, "--headless"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,  # Or a second line would wait in a buffer where `select` does not see it.
            env=environment,
        )
        self.lines: list[str] = []

    def wait_for(self, text: str) -> str:
        """Read lines until one contains a text."""
        assert self.process.stdout is not None
        end = time.monotonic() + LIMIT
        while time.monotonic() < end:
            if not select.select([self.process.stdout], [], [], 0.1)[0]:
                continue
            line = self.process.stdout.readline().decode()
            assert line, f"it ended without {text!r}: {self.lines}, {self.finish()}"
            self.lines.append(line.rstrip())
            if text in line:
                return line
        raise AssertionError(f"no {text!r} within {LIMIT} s: {self.lines}")

    def finish(self, number: int | None = None) -> tuple[int, str, str]:
        """Send a signal if one is given, wait, and give exit code and both outputs from here on."""
        if number is not None:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=LIMIT)
        return self.process.returncode, out.decode(), err.decode()


@pytest.fixture
def start_sim():
    started: list[SimProcess] = []

    def start(*arguments: str) -> SimProcess:
        started.append(SimProcess(*arguments))
        return started[-1]

    yield start
    for sim in started:
        if sim.process.poll() is None:
            sim.process.kill()
            sim.process.communicate()
        for stream in (sim.process.stdout, sim.process.stderr):
            assert stream is not None
            stream.close()


def read_report(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text())


def check_promises(report: dict[str, Any]) -> None:
    """What must hold on any machine, however slow."""
    assert report["ticks_without_command"] == 0
    assert report["largest_step"] <= MAX_VELOCITY * CONTROL_PERIOD * 1.000001
    assert report["tracking_ticks"] + report["holding_ticks"] == report["ticks"]
    assert report["seconds"] == pytest.approx(report["ticks"] * CONTROL_PERIOD)


@pytest.mark.parametrize("transport", ["tcp_url", "zenoh_url"])
def test_follows_a_path(transport: str, service_process, start_sim, tmp_path: Path) -> None:
    url = getattr(service_process, transport)
    sim = start_sim(url, "--duration", "3", "--ramp", "0.1", "--feed-forward", "--report", str(tmp_path / "r.json"))
    code, out, err = sim.finish()
    assert (code, err) == (0, "")
    assert "\x1b" not in out
    assert "left wrist off target [mm]" in out
    report = read_report(tmp_path / "r.json")
    check_promises(report)
    assert report["ticks"] == 150
    assert report["tracking_ticks"] > 0
    assert report["wrist_error_mm"]["left"]["p50"] < 30.0
    assert report["settings"]["url"] == url


def test_plays_a_recorded_motion(service_process, start_sim, shared_data: Path, tmp_path: Path) -> None:
    clip = shared_data / "motions" / "g1moves_M_Move1.npz"
    arguments = ["--motion", str(clip), "--duration", "5", "--ramp", "0.1", "--report", str(tmp_path / "r.json")]
    sim = start_sim(service_process.tcp_url, *arguments)
    code, _, err = sim.finish()
    assert (code, err) == (0, "")
    report = read_report(tmp_path / "r.json")
    check_promises(report)
    assert report["ticks"] == 250


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("feed_forward", [[], ["--feed-forward"]], ids=["sagging", "feed-forward"])
@pytest.mark.parametrize("clip", ["g1moves_M_Move1", "g1moves_B_DadDance", "g1moves_B_HandsUp", "asap_CR7_level1"])
def test_plays_a_whole_recording(
    clip: str, feed_forward: list[str], service_process, start_sim, shared_data: Path, tmp_path: Path, capsys
) -> None:
    file = shared_data / "motions" / f"{clip}.npz"
    sim = start_sim(service_process.tcp_url, "--motion", str(file), "--report", str(tmp_path / "r.json"), *feed_forward)
    sim.wait_for("follows the recording")
    code, out, err = sim.process.wait(LIMIT * 4), *sim.finish()[1:]
    assert (code, err) == (0, "")
    check_promises(read_report(tmp_path / "r.json"))
    with capsys.disabled():
        print(f"\n{clip} {feed_forward}\n{out}")


def test_holds_while_the_service_is_dead_and_resumes(start_service, start_sim, tmp_path: Path) -> None:
    service = start_service("--zenoh", "off", "--http", "off")
    sim = start_sim(service.tcp_url, "--duration", "600", "--ramp", "0.1", "--report", str(tmp_path / "r.json"))
    sim.wait_for("following")
    service.stop(signal.SIGKILL)
    sim.wait_for("holding the last command: Service")
    start_service("--tcp", service.ready["tcp"], "--zenoh", "off", "--http", "off")
    sim.wait_for("the service was restarted")
    code, _, err = sim.finish(signal.SIGTERM)
    assert (code, err) == (0, "")
    report = read_report(tmp_path / "r.json")
    check_promises(report)
    assert any("ServiceUnavailable" in reason for reason in report["hold_reasons"])
    assert report["tracking_ticks"] > 0
    assert any("following after" in event for event in report["events"])


def test_a_hung_service_does_not_stop_the_physics(start_service, start_sim, tmp_path: Path) -> None:
    service = start_service("--zenoh", "off", "--http", "off")
    sim = start_sim(service.tcp_url, "--duration", "600", "--ramp", "0.1", "--report", str(tmp_path / "r.json"))
    sim.wait_for("following")
    service.process.send_signal(signal.SIGSTOP)
    try:
        assert "no answer" in sim.wait_for("holding the last command")
        time.sleep(HANG)
    finally:
        service.process.send_signal(signal.SIGCONT)
    sim.wait_for("following after")
    code, _, _ = sim.finish(signal.SIGINT)
    assert code == 0
    report = read_report(tmp_path / "r.json")
    check_promises(report)
    assert report["holding_ticks"] > 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_its_report(number: int, service_process, start_sim, tmp_path: Path) -> None:
    sim = start_sim(service_process.tcp_url, "--duration", "600", "--report", str(tmp_path / "r.json"))
    sim.wait_for("follows the path")
    code, out, err = sim.finish(number)
    assert (code, err) == (0, "")
    assert "ticks without a command" in out
    check_promises(read_report(tmp_path / "r.json"))


def test_without_a_display_it_says_so_and_runs(service_process, tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    arguments = [service_process.tcp_url, "--duration", "0.5"]
    done = subprocess.run(
        [sys.executable, "-m", "sim_client", *arguments], env=environment, capture_output=True, text=True, timeout=LIMIT
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "no display, so no window (DISPLAY is not set); running headless" in done.stdout


def complaint(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line on standard error with which a command line is refused."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM,)}
    try:
        assert main(arguments) == EXIT_USAGE
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("ik-sim: ")
    assert "Traceback" not in captured.out
    return lines[0]


def test_no_service(capsys: pytest.CaptureFixture[str]) -> None:
    line = complaint(capsys, "tcp://127.0.0.1:1", "--headless")
    assert "127.0.0.1:1" in line
    assert "ik-service serve" in line


def test_a_token_file_that_cannot_be_used(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = complaint(capsys, "tcp://127.0.0.1:1", "--headless", "--token-file", str(tmp_path / "none"))
    assert str(tmp_path / "none") in line


def test_wrong_address(capsys: pytest.CaptureFixture[str]) -> None:
    assert "tcp://HOST:PORT" in complaint(capsys, "http://127.0.0.1:1", "--headless")


def test_wrong_robot(capsys: pytest.CaptureFixture[str]) -> None:
    assert "packaged robots: g1" in complaint(capsys, "--robot", "no_such_robot", "--headless")


def test_wrong_path_and_motion(service_process, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    url = service_process.tcp_url
    assert "there are circles, reach, wave" in complaint(capsys, url, "--headless", "--path", "spiral")
    absent = tmp_path / "absent.npz"
    assert f"{absent}: no such file" in complaint(capsys, url, "--headless", "--motion", str(absent))


def test_another_robot_than_the_service(service_process, toy_files, capsys: pytest.CaptureFixture[str]) -> None:
    line = complaint(capsys, service_process.tcp_url, "--headless", "--robot", str(toy_files[0]))
    assert "serves robot 'g1' with other arm joints than 'toy'" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--timeout", "0.02"], "less than a tick"),
        (["--timeout", "0"], "less than a tick"),
        (["--timeout", "nan"], "less than a tick"),
        (["--max-step", "-1"], "--max-step"),
        (["--duration", "0"], "--duration"),
        (["--duration", "inf"], "--duration"),
        (["--drag", "--headless"], "--drag needs the window"),
        (["--video", "film.txt"], "--video film.txt"),
    ],
)
def test_options_that_make_no_run(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert words in complaint(capsys, *arguments)


def test_every_default_makes_a_run() -> None:
    Settings(url="tcp://127.0.0.1:12345")
    with pytest.raises(SettingsError):
        Settings(url="tcp://127.0.0.1:12345", timeout=float("inf"))


def test_help_teaches_without_loading_mujoco() -> None:
    code = (
        "import sys\n"
        "from sim_client.cli import main\n"
        "try: main(['--help'])\n"
        "finally: print(sorted({'mujoco', 'rich', 'numpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == 0
    assert done.stdout.endswith("[]\n")
    text = re.sub(r"\s+", " ", done.stdout)
    for words in ("examples:", "exit codes:", "--max-velocity", "--feed-forward", "--eyes DIR"):
        assert words in text


def test_defaults_in_the_help_are_those_of_the_settings() -> None:
    done = subprocess.run([sys.executable, "-m", "sim_client", "--help"], capture_output=True, text=True, timeout=LIMIT)
    text = re.sub(r"\s+", " ", done.stdout)
    settings = Settings(url="")
    assert f"largest velocity of a joint's command ({settings.max_velocity:g})" in text
    assert f"hand its arms over ({settings.ramp:g})" in text
    assert f"less than {CONTROL_PERIOD:g} ({settings.timeout:g})" in text
    assert f"({settings.path})" in text
    assert f"({settings.robot})" in text


def test_a_missing_extra_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    import sim_client.extras as extras

    assert missing_extra("sim", "service") is None
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "mujoco" else object())
    assert missing_extra("sim") == "package mujoco is missing: pip install 'ik-service[sim]'"
    assert missing_extra("service") is None
