"""Does a good client notice a hostile one? A real service, real sockets, in turns with and without hostile frames.

The hostile client is a process of its own with one connection: it makes its frames beforehand, sends them at a rate or
as fast as the service takes them, throws away what comes back, and connects again when it is thrown out. The good
client sends plain solves at a fixed rate and times each from the moment it was meant to be sent, so that waiting to
send counts.
"""

import contextlib
import json
import random
import select
import socket
import statistics
import struct
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.fuzz.examples import requests
from benchmarks.fuzz.mutator import Mutator
from ik_proto import JSON, encode_frame

RATE_HZ = 200.0
"""Of the good client's requests."""
TURN_S = 2.0
FRAMES = 5000
"""Different hostile frames; they are sent over and over."""
SIDES = {"alone": 0.0, "beside 1,000 hostile frames a second": 1000.0, "beside a hostile flood": 1e9}
"""What the good client's turns are measured beside, and how fast that sends [1/s]."""
_LENGTH = struct.Struct(">I")


def measure(rounds: int, seed: int, corpus: Path | None) -> dict[str, Any]:
    """Time the good client, in turns without and with the hostile one.

    Args:
        rounds: How many turns of each.
        seed: Of the hostile frames.
        corpus: Folder with more of them, as a fuzzing run of `json-requests` leaves it.

    Returns:
        For each of `SIDES`, percentiles of each turn [us] and the hostile frames that were sent.
    """
    turns: dict[str, list[dict[str, float]]] = {side: [] for side in SIDES}
    with _started("-m", "ik_service", "serve", *_SERVE) as (_, ready):
        host, port = json.loads(ready)["tcp"].rsplit(":", 1)
        attack = ("-m", "benchmarks.fuzz.live", host, port, str(seed), *([str(corpus)] if corpus else []))
        with closing(_Good((host, int(port)))) as good, _started(*attack) as (hostile, _):
            good.turn(1.0)
            for _ in range(rounds):
                for side, rate in SIDES.items():
                    _tell(hostile, str(rate))
                    took = good.turn(TURN_S)
                    turns[side].append({**_percentiles(took), "hostile": int(_tell(hostile, "stop"))})
    return {"turns": turns, "rate_hz": RATE_HZ, "turn_s": TURN_S}


def show(result: dict[str, Any], console: Console) -> None:
    """Print what came of it."""
    count = len(next(iter(result["turns"].values())))
    table = Table(title=f"Round trips of a good client at {RATE_HZ:.0f} Hz in us, medians of {count} turns")
    for title in ("", "p50", "p90", "p99", "p99 of the turns", "hostile frames a second"):
        table.add_column(title, justify="right" if title else "left")
    for side, turns in result["turns"].items():
        medians = [statistics.median(turn[p] for turn in turns) for p in ("p50", "p90", "p99", "hostile")]
        spread = f"{min(turn['p99'] for turn in turns):.0f} to {max(turn['p99'] for turn in turns):.0f}"
        table.add_row(side, *(f"{value:.0f}" for value in medians[:3]), spread, f"{medians[3] / TURN_S:,.0f}")
    console.print(table)


_SERVE = ("--tcp", "127.0.0.1:0", "--zenoh", "off", "--http", "off", "--log-format", "json", "--log-level", "error")


class _Good:
    """One connection that asks at a fixed rate."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._socket = socket.create_connection(address, timeout=10.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        document = JSON.decode(requests(JSON)[-1])
        self._frame = encode_frame(JSON.encode({**document, "collision": "off"}))

    def turn(self, seconds: float) -> np.ndarray:
        """Round-trip times from when each request was meant to be sent [us]."""
        count = round(seconds * RATE_HZ)
        start = time.perf_counter() + 0.01
        took = np.zeros(count)
        for index in range(count):
            intended = start + index / RATE_HZ
            time.sleep(max(0.0, intended - time.perf_counter()))
            self._socket.sendall(self._frame)
            data = self._socket.recv(65536)
            while len(data) < 4 or len(data) < 4 + _LENGTH.unpack_from(data)[0]:
                data += self._socket.recv(65536)
            took[index] = (time.perf_counter() - intended) * 1e6
        return took

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


def _percentiles(took: np.ndarray) -> dict[str, float]:
    p50, p90, p99, longest = np.percentile(took, (50, 90, 99, 100)).round(1).tolist()
    return {"p50": p50, "p90": p90, "p99": p99, "max": longest}


@contextmanager
def _started(*command: str) -> Generator[tuple[subprocess.Popen[str], str]]:
    """Run a Python program; give it and the first line it prints."""
    with subprocess.Popen(
        [sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        try:
            assert child.stdout is not None
            if not select.select([child.stdout], [], [], 60.0)[0] or not (line := child.stdout.readline()):
                raise SystemExit(f"{' '.join(command)} did not start")
            yield child, line
        finally:
            child.terminate()


def _tell(child: subprocess.Popen[str], word: str) -> str:
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.write(word + "\n")
    child.stdin.flush()
    return child.stdout.readline()


def attack(address: tuple[str, int], seed: int, corpus: Path | None) -> None:
    """The hostile process: told a rate it begins, told to stop it stops and says how many frames it sent."""
    rng = random.Random(seed)
    mutator = Mutator(JSON, requests(JSON), rng)
    frames = [encode_frame(mutator.body()) for _ in range(FRAMES)]
    frames += [mutator.stream() for _ in range(FRAMES // 50)]
    frames += [file.read_bytes() for file in sorted(corpus.iterdir())] if corpus else []
    rng.shuffle(frames)
    print("ready", flush=True)
    while rate := sys.stdin.readline():
        print("going", flush=True)
        sent, began = 0, time.perf_counter()
        while not _told_to_stop():
            if float(rate) == 0.0:
                time.sleep(0.01)
                continue
            with contextlib.suppress(OSError), socket.create_connection(address, timeout=1.0) as connection:
                connection.settimeout(0.05)
                while not _told_to_stop():
                    if sent > (time.perf_counter() - began) * float(rate):
                        time.sleep(0.001)
                        continue
                    sent += 1
                    _throw(connection, frames[sent % len(frames)])
        sys.stdin.readline()
        print(sent, flush=True)


def _told_to_stop() -> bool:
    return bool(select.select([sys.stdin], [], [], 0.0)[0])


def _throw(connection: socket.socket, frame: bytes) -> None:
    """Send a frame and read away what there is; raises OSError where the service has hung up."""
    connection.sendall(frame)
    while select.select([connection], [], [], 0.0)[0]:
        if not connection.recv(65536):
            raise ConnectionResetError


if __name__ == "__main__":
    attack((sys.argv[1], int(sys.argv[2])), int(sys.argv[3]), Path(sys.argv[4]) if len(sys.argv) > 4 else None)
