"""`ik-xr` between a headset made of sockets, a service and a simulated robot: all real processes."""

import asyncio
import json
import re
import select
import subprocess
import sys
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest
from xr_samples import at, controller, packet

from ik_client import IKClient
from ik_client.robot_end import RobotLink
from xr_client import session
from xr_client.packets import encode_packet
from xr_client.recording import Recorder
from xr_client.settings import Settings, SettingsError

LIMIT = 60.0
SIDEWAYS = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
UP = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
ATTEMPTS = 5


@contextmanager
def running(*command: Any, log: Path) -> Generator[tuple[subprocess.Popen[str], dict[str, Any]]]:
    """A process and the line of JSON with which it says that it is ready."""
    with (
        log.open("w") as errors,
        subprocess.Popen(
            [sys.executable, "-m", *map(str, command)], stdout=subprocess.PIPE, stderr=errors, text=True
        ) as process,
    ):
        assert process.stdout is not None
        try:
            assert select.select([process.stdout], [], [], LIMIT)[0], log.read_text()
            line = process.stdout.readline()
            assert line, log.read_text()
            yield process, json.loads(line)
        finally:
            process.kill()


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Iterator[str]:
    """Address of a simulated robot."""
    log = tmp_path_factory.mktemp("robot") / "log"
    with running("sim_client", "--listen", "127.0.0.1:0", "--headless", log=log) as (_, ready):
        yield f"tcp://{ready['listen']}"


class Headset:
    """A page made of a socket: sends its controllers 72 times a second and listens to the HUD."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.seq = 0
        self.squeeze = 0.0
        self.where = [at(-0.2, 1.2, -0.4), at(0.2, 1.2, -0.4)]
        self.hud: dict[str, Any] = {}

    async def live(self) -> None:
        """Send and listen until cancelled."""
        await asyncio.gather(self._send(), self._listen())

    async def _send(self) -> None:
        while True:
            self.seq += 1
            # A hand that stands still to the bit is no hand.
            left, right = (controller(place + 1e-5 * (self.seq % 2) * SIDEWAYS, self.squeeze) for place in self.where)
            await self.socket.send_bytes(encode_packet(packet(self.seq, left=left, right=right)))
            await asyncio.sleep(1 / 72)

    async def _listen(self) -> None:
        async for message in self.socket:
            said = json.loads(message.data)
            if said["type"] == "hud":
                self.hud = said
            else:
                await self.socket.send_json({"type": "pong", "t_ms": said["t_ms"], "page_ms": self.seq * 11.0})

    def changes(self) -> int:
        """How often a state has changed."""
        return self.hud["left"]["changes"] + self.hud["right"]["changes"]

    async def until(self, condition) -> None:
        end = time.monotonic() + LIMIT
        while not (self.hud and condition(self.hud)):
            assert time.monotonic() < end, self.hud
            await asyncio.sleep(0.01)


def states(hud) -> tuple[str, str]:
    return hud["left"]["state"], hud["right"]["state"]


def wrists(ik: IKClient, robot: RobotLink) -> np.ndarray:
    """Where the robot's end wants its wrists, left and right, shape (2, 3) [m]."""
    state = robot.read()
    reply = ik.fk(np.asarray(state.q_set), state.waist)
    return np.array([reply.left_wrist[:3, 3], reply.right_wrist[:3, 3]])


def test_a_headset_moves_the_robot(robot, service_process, tmp_path):
    """Connect, grip, move by 6 cm, let go: the wrist has moved by 6 cm, and the arms hold when the headset is gone."""
    keep = tmp_path / "session.ikxr"
    command = ["xr_client", "--service", service_process.tcp_url, "--robot", robot, "--local-only", "--local-port", 0]

    async def work(local: str, watching: RobotLink, ik: IKClient) -> None:
        url, token = local.split("/#")
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(f"{url}/pose", params={"token": token}, headers={"Origin": url}) as socket,
        ):
            headset = Headset(socket)
            life = asyncio.create_task(headset.live())
            await headset.until(lambda hud: not hud["note"])  # the robot is ready
            headset.squeeze = 1.0
            for _ in range(ATTEMPTS):
                await headset.until(lambda hud: states(hud) == ("active", "active"))
                await asyncio.sleep(1.1)  # the authority has risen
                changes, before = headset.changes(), wrists(ik, watching)
                for _ in range(30):
                    headset.where = [place + 0.002 * UP for place in headset.where]
                    await asyncio.sleep(0.02)
                # A machine that stalls for a tenth of a second loses the hand: then once more.
                goal = before + np.array([0.0, 0.0, 0.06])
                await headset.until(
                    lambda _hud, changes=changes, goal=goal: (
                        headset.changes() != changes or np.abs(wrists(ik, watching) - goal).max() < 0.005
                    )
                )
                if headset.changes() == changes:
                    break
            else:
                pytest.fail("the hands were lost in every attempt")
            hud = headset.hud
            assert states(hud) == ("active", "active")
            assert hud["note"] == ""
            assert 0.0 <= hud["left"]["position_error_mm"] < 5.0
            assert hud["latency_ms"]["service"] > 0.0
            assert hud["latency_ms"]["solve"] > 0.0
            headset.squeeze = 0.0
            await headset.until(lambda hud: states(hud) == ("disarmed", "disarmed"))
            life.cancel()

    with (
        running(*command, "--record", keep, log=tmp_path / "log") as (process, ready),
        RobotLink(robot) as watching,
        IKClient(service_process.tcp_url, timeout=2.0) as ik,
    ):
        assert ready["pages"] == []
        asyncio.run(asyncio.wait_for(work(ready["local"], watching, ik), LIMIT))
        process.terminate()
        said, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, (tmp_path / "log").read_text()
    assert "engagements" in said
    assert "the robot holds" in said
    assert "Traceback" not in (tmp_path / "log").read_text()

    assert keep.stat().st_size > 100 * 148


@pytest.mark.slow
def test_a_recording_is_replayed(robot, service_process, tmp_path):
    """Without a headset: the recorded hands engage and move, and the command ends with the recording."""
    file = tmp_path / "a.ikxr"
    with file.open("wb") as out:
        recorder = Recorder(out)
        for k in range(150):
            # Several grips: on a busy machine the service may be late for one of them.
            squeeze = 1.0 if k % 50 > 10 else 0.0
            left = controller(at(-0.2, 1.2 + 1e-4 * k), squeeze)
            recorder.write(encode_packet(packet(k, left=left)), k / 72)
    command = [sys.executable, "-m", "xr_client", "--service", service_process.tcp_url, "--robot", robot]
    run = subprocess.run([*command, "--replay", str(file)], capture_output=True, text=True, timeout=LIMIT)
    assert run.returncode == 0, run.stderr
    assert "left arm: active" in run.stdout
    assert re.search(r"[1-9] engagements", run.stdout)


def test_a_service_for_another_robot_is_told(robot, service_process, monkeypatch):
    class Other(RobotLink):
        @property
        def welcome(self):
            return replace(super().welcome, joint_names=("elbow",))

    monkeypatch.setattr(session, "RobotLink", Other)
    with pytest.raises(SettingsError, match="start both for the same robot"):
        session.run(
            Settings(service=service_process.tcp_url, robot=robot), print, terminal=False, keep_going=lambda: False
        )
