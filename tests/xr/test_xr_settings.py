"""The command's options, its mistakes in one line each, and its browser."""

import threading
from functools import partial

import pytest

from ik_client.command import EXIT_USAGE
from ik_client.robot_end import RobotLink
from ik_client.start import SettingsError
from xr_client import desktop, session
from xr_client.cli import main
from xr_client.settings import Settings


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"reference": "head"}, "standing, openwbt"),
        ({"scale": 0.8, "arm_length": 0.6}, "give one"),
        ({"scale": -1.0}, "positive"),
        ({"scale": float("nan")}, "positive"),
        ({"scale": 2.0, "reference": "openwbt"}, "absolute"),
        ({"record": "a", "replay": "b"}, "do not go together"),
        ({"emulate": True, "replay": "b"}, "needs no headset"),
        ({"video": "http://127.0.0.1"}, "auto, off, shm:NAME"),
        ({"port": 65536}, "--port 65536"),
        ({"local_port": -1}, "--local-port -1"),
    ],
)
def test_options_that_contradict_each_other(options, words):
    with pytest.raises(SettingsError, match=words):
        Settings(**options)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--replay", "absent.ikxr"], "absent.ikxr cannot be read"),
        (["--reference", "head"], "choose one of"),
        (["--robot", "tcp://127.0.0.1:1"], "robot tcp://127.0.0.1:1: no state"),
        (["--robot", "nonsense"], "nonsense"),
        (["--ca", "absent.pem"], "absent.pem holds no certificate"),
    ],
)
def test_a_mistake_is_one_line(arguments, words, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr(session, "RobotLink", partial(RobotLink, connect_timeout=0.1))
    assert main(arguments) == EXIT_USAGE
    said = capsys.readouterr().err
    assert said.startswith("ik-xr: ")
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "local_only"),
    [([], True), (["--port", "9000"], False), (["--host", "::"], False), (["--local-port", "0"], True)],
)
def test_an_emulated_headset_needs_no_network_unless_a_port_is_named(arguments, local_only, monkeypatch):
    asked: list[Settings] = []

    def run(settings, *_, **__):
        asked.append(settings)
        raise SettingsError("enough")

    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr(session, "run", run)
    assert main(["--emulate", *arguments]) == EXIT_USAGE
    assert asked[0].emulate
    assert asked[0].local_only is local_only


@pytest.mark.parametrize(("screen", "opened"), [("", False), (":0", True)])
def test_a_browser_is_opened_only_where_there_is_a_screen(screen, opened, monkeypatch):
    there = threading.Event()
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", screen)
    monkeypatch.setattr(desktop.sys, "platform", "linux")
    monkeypatch.setattr(desktop.webbrowser, "open", lambda url: there.set())
    assert desktop.open_page("http://localhost/") is opened
    assert there.wait(10.0 if opened else 0.0) is opened
