"""What the service adds to its transport: round trips of `ik-service serve` next to bare echoes of the same bytes.

Real processes over loopback, measured in turns within one run, so that both sides see the same machine:

- TCP: a solve that ignores collisions, against an echo behind the same server class, framing and event loop. Same
  socket code on the client side, no codec in it.
- OpenWBT: its client as it is (two sends, Nagle's algorithm on, Python's json), against ours and against a server that
  writes as theirs does.
- Zenoh: a solve, against a queryable that echoes.

With two cores or more, the servers are pinned to one and the client to another. Where to put two processes that wake
each other is the scheduler's choice: it puts a short echo beside its client and a longer solve on another core, and
waking a core costs more than a solve. `--placement` takes other choices: both on one core, or the scheduler's own.

    python benchmarks/transport_overhead.py [--quick] [--placement apart|together|free] [--json FILE]
"""

import argparse
import asyncio
import json
import os
import select
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import uvloop
import zenoh
from rich.console import Console
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.workloads import tracking
from ik_proto import JSON, MSGPACK, FkRequest, SolveRequest, Status, request_document
from ik_proto.host_port import HostPort
from ik_service.config import Config
from ik_service.engine import Engine
from ik_service.tcp_server import TcpServer
from ik_service.zenoh_server import listen_locators, zenoh_config

TCP_LIMIT, OPENWBT_LIMIT_MS, ZENOH_LIMIT = 2.5, 1.0, 1.3
BLOCK = 200
"""Round trips before it is the other side's turn."""

_LENGTH = struct.Struct(">I")

Call = Callable[[int], None]


class Echo:
    """Answers every body with itself."""

    hopeless = 0

    def answer(self, body: bytes, _arrived: float) -> bytes:
        """Give it back."""
        return body

    def refuse(self, body: bytes, _status: Status, _message: str) -> bytes:
        """Give it back."""
        return body

    def stream_of(self, _body: bytes) -> str:
        """Know no streams."""
        return ""

    def supersede(self, _stream: str) -> None:
        """Know no streams."""


# The other sides: bare echoes, and a server that writes as OpenWBT's does. Each prints its address and serves.


def serve_tcp_echo() -> None:
    async def main() -> None:
        server = TcpServer(Echo, lambda _status, _message: b"")
        print(await server.start(HostPort("127.0.0.1", 0)), flush=True)
        await asyncio.Event().wait()

    uvloop.run(main())


def serve_zenoh_echo() -> None:
    config = zenoh_config("tcp/127.0.0.1:0")
    session = zenoh.open(config)
    queryable = session.declare_queryable("echo", zenoh.handlers.FifoChannel(256), complete=True)
    print(listen_locators(config)[0], flush=True)
    queries = queryable.handler
    while True:
        with queries.recv() as query:
            assert query.payload is not None
            query.reply("echo", query.payload.to_bytes())


def serve_like_openwbt() -> None:
    """Header and body in two sends, Nagle's algorithm on, Python's json, one thread a connection, no solving at all."""
    listener = socket.create_server(("127.0.0.1", 0))
    print(HostPort(*listener.getsockname()), flush=True)
    reply = json.dumps({"sol_q": [0.1234567890123456] * 14, "success": True, "error_msg": ""}).encode()

    def talk(connection: socket.socket) -> None:
        while header := connection.recv(4):
            json.loads(_exactly(connection, _LENGTH.unpack(header)[0]))
            connection.send(_LENGTH.pack(len(reply)))
            connection.send(reply)

    while True:
        threading.Thread(target=talk, args=(listener.accept()[0],), daemon=True).start()


ROLES = {"tcp-echo": serve_tcp_echo, "zenoh-echo": serve_zenoh_echo, "openwbt": serve_like_openwbt}


@contextmanager
def process(*command: str) -> Generator[str]:
    """Run a Python program; give the first line it prints."""
    child = subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert child.stdout is not None
        if not select.select([child.stdout], [], [], 60.0)[0]:
            raise SystemExit(f"{command[0]} did not start within 60 s")
        line = child.stdout.readline().strip()
        if not line:
            raise SystemExit(f"{' '.join(command)} ended with {child.wait()} instead of starting")
        yield line
    finally:
        child.terminate()
        child.wait(10)


# The clients: each is a function that makes the i-th round trip.


def tcp_caller(address: str, bodies: list[bytes]) -> Call:
    host = HostPort.parse(address)
    connection = socket.create_connection((host.host, host.port), timeout=10)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    frames = [_LENGTH.pack(len(body)) + body for body in bodies]

    def call(index: int) -> None:
        connection.sendall(frames[index % len(frames)])
        data = connection.recv(65536)
        while len(data) < 4 or len(data) < 4 + _LENGTH.unpack_from(data)[0]:
            data += connection.recv(65536)

    return call


def openwbt_caller(address: str, requests: list[dict[str, Any]]) -> Call:
    host = HostPort.parse(address)
    connection = socket.create_connection((host.host, host.port), timeout=1.0)

    def call(index: int) -> None:
        payload = json.dumps(requests[index % len(requests)]).encode("utf-8")
        connection.send(_LENGTH.pack(len(payload)))
        connection.send(payload)
        (length,) = _LENGTH.unpack(connection.recv(4))
        assert json.loads(_exactly(connection, length))["success"]

    return call


def zenoh_caller(stack: ExitStack, locator: str, key: str, bodies: list[bytes]) -> Call:
    config = zenoh_config("tcp/127.0.0.1:0", locator)
    for name, value in (("mode", "client"), ("listen/endpoints", [])):
        config.insert_json5(name, json.dumps(value))
    session = stack.enter_context(zenoh.open(config))

    def call(index: int) -> None:
        reply = session.get(key, payload=bodies[index % len(bodies)], timeout=5.0).recv()
        assert reply.ok is not None
        reply.ok.payload.to_bytes()

    return call


def _exactly(connection: socket.socket, count: int) -> bytes:
    data = connection.recv(count)
    while len(data) < count:
        data += connection.recv(count - len(data))
    return data


# The measurement.


def in_turns(first: Call, second: Call, rounds: int, block: int = BLOCK) -> tuple[np.ndarray, np.ndarray]:
    """Round-trip times of both sides [us], shape (rounds, block), taken in turns after one block of warm-up."""
    times = np.zeros((2, rounds, block))
    for side in (first, second):
        _block(side, block)
    for turn in range(rounds):
        for index, side in enumerate((first, second)):
            times[index, turn] = _block(side, block)
    return times[0], times[1]


def _block(call: Call, count: int) -> np.ndarray:
    times = np.zeros(count)
    for index in range(count):
        started = time.perf_counter()
        call(index)
        times[index] = (time.perf_counter() - started) * 1e6
    return times


def ratio(ours: np.ndarray, bare: np.ndarray) -> float:
    """Median over the turns of the ratio of medians: turns are short, so both sides of one see the same machine."""
    return statistics.median(np.median(ours, axis=1) / np.median(bare, axis=1))


def summary(times: np.ndarray) -> dict[str, float]:
    p50, p95, p99 = np.percentile(times, (50, 95, 99)).round(1).tolist()
    return {"n": times.size, "p50_us": p50, "p95_us": p95, "p99_us": p99}


def requests(count: int) -> list[SolveRequest]:
    """Tracking frames, each starting from the solution of the one before."""
    engine = Engine.build(Config(), "", "")
    solver = engine.solvers[engine.about.default_preset]
    workload = tracking(engine.robot, count)
    made, q = [], workload.first
    for index, (left, right) in enumerate(zip(workload.left, workload.right, strict=True)):
        made.append(SolveRequest(left_wrist=left, right_wrist=right, q=q, dq=np.zeros(len(q)), id=index + 1))
        q = solver.solve(left, right, q, collision="off").q
    return made


def openwbt_form(request: SolveRequest) -> dict[str, Any]:
    return {
        "left_wrist": request.left_wrist.tolist(),
        "right_wrist": request.right_wrist.tolist(),
        "current_lr_arm_q": request.q.tolist(),
        "current_lr_arm_dq": request.dq.tolist(),
    }


def cores(placement: str) -> tuple[set[int], set[int]]:
    """Cores of the servers and of the client."""
    available = sorted(os.sched_getaffinity(0))
    if placement == "free" or len(available) < 2:
        return set(available), set(available)
    return {available[-1]}, {available[0 if placement == "apart" else -1]}


def measure(rounds: int, placement: str) -> dict[str, Any]:
    problems = requests(BLOCK)
    documents = [request_document(request) for request in problems]
    of_servers, of_client = cores(placement)
    with ExitStack() as stack:
        os.sched_setaffinity(0, of_servers)  # a process starts with the cores of its parent
        serve = ("serve", "--tcp", "127.0.0.1:0", "--zenoh", "tcp/127.0.0.1:0", "--http", "off", "--log-format", "json")
        serve += ("--collision", "off")  # the messages are what is measured, not what a solve takes
        ready = json.loads(stack.enter_context(process("-m", "ik_service", *serve)))
        echo, zenoh_echo, theirs = (stack.enter_context(process(__file__, "--role", role)) for role in ROLES_IN_ORDER)
        os.sched_setaffinity(0, of_client)

        bodies = [JSON.encode(document) for document in documents]
        tcp = in_turns(tcp_caller(ready["tcp"], bodies), tcp_caller(echo, bodies), rounds)
        fk_bodies = [JSON.encode(request_document(FkRequest(q=request.q))) for request in problems]
        fk = in_turns(tcp_caller(ready["tcp"], fk_bodies), tcp_caller(echo, fk_bodies), max(2, rounds // 4))

        old = [openwbt_form(request) for request in problems]
        openwbt = in_turns(openwbt_caller(ready["tcp"], old), openwbt_caller(theirs, old), rounds=3, block=20)

        packed = [MSGPACK.encode(document) for document in documents]
        ours = zenoh_caller(stack, ready["zenoh"], f"ik/{ready['robot']}/rpc", packed)
        bare = zenoh_caller(stack, zenoh_echo, "echo", packed)
        over_zenoh = in_turns(ours, bare, rounds)
    return {
        "kernel": ready["kernel"],
        "placement": placement,
        "tcp": {"ours": summary(tcp[0]), "bare": summary(tcp[1]), "ratio": ratio(*tcp), "limit": TCP_LIMIT},
        "tcp fk": {"ours": summary(fk[0]), "bare": summary(fk[1]), "ratio": ratio(*fk)},
        "openwbt": {
            "ours": summary(openwbt[0]),
            "bare": summary(openwbt[1]),
            "ratio": ratio(*openwbt),
            "limit_ms": OPENWBT_LIMIT_MS,
        },
        "zenoh": {
            "ours": summary(over_zenoh[0]),
            "bare": summary(over_zenoh[1]),
            "ratio": ratio(*over_zenoh),
            "limit": ZENOH_LIMIT,
        },
    }


ROLES_IN_ORDER = ("tcp-echo", "zenoh-echo", "openwbt")


PACKAGES = ("ik-service", "numpy", "casadi", "pin", "uvloop", "eclipse-zenoh", "orjson", "msgpack")

ROWS = {
    "tcp": ("TCP solve", "bare echo", f"<= {TCP_LIMIT}x"),
    "tcp fk": ("TCP fk", "bare echo", ""),
    "openwbt": ("OpenWBT client, our server", "a server that writes as theirs", f"p50 < {OPENWBT_LIMIT_MS} ms"),
    "zenoh": ("Zenoh solve", "bare query echo", f"<= {ZENOH_LIMIT}x"),
}


def show(results: dict[str, Any]) -> None:
    table = Table(title=f"Round trips on loopback in us, kernel {results['kernel']}, processes {results['placement']}")
    for title in ("ours", "p50", "p95", "p99", "next to", "p50", "p95", "p99", "ratio of p50", "wanted"):
        table.add_column(title, justify="left" if title in ("ours", "next to", "wanted") else "right")
    for key, (ours, bare, wanted) in ROWS.items():
        result = results[key]
        numbers = {
            side: [f"{result[side][name]:.0f}" for name in ("p50_us", "p95_us", "p99_us")] for side in ("ours", "bare")
        }
        table.add_row(ours, *numbers["ours"], bare, *numbers["bare"], f"{result['ratio']:.2f}", wanted)
    Console(width=140).print(table)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the rounds")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    parser.add_argument("--placement", choices=("apart", "together", "free"), default="apart", help="see above (apart)")
    parser.add_argument("--role", choices=ROLES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.role:
        ROLES[options.role]()
        return 0
    results = measure(5 if options.quick else 50, options.placement)
    show(results)
    if options.json:
        options.json.write_text(json.dumps({"environment": environment(PACKAGES), **results}, indent=2) + "\n")
    met = (
        results["tcp"]["ratio"] <= TCP_LIMIT
        and results["openwbt"]["ours"]["p50_us"] < OPENWBT_LIMIT_MS * 1e3
        and results["zenoh"]["ratio"] <= ZENOH_LIMIT
    )
    print("all limits met" if met else "a limit is missed")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
