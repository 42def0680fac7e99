"""Clients that misbehave, in one process: slow readers, slow writers, senders of junk, floods.

    python -m benchmarks.load.villains HOST PORT [--each N] [--seed N]

Says `ready` once all are connected, goes on until its standard input ends, then prints what it did as JSON. Whoever is
thrown out connects again at once.
"""

import argparse
import asyncio
import json
import random
import socket
import struct
import sys
from collections import Counter
from collections.abc import Awaitable, Callable

import uvloop

from ik_proto import encode_frame

FRAMES_A_WRITE = 64
_RECEIVE_BYTES = 65536
_RETRY_S = 0.01
_LENGTH = struct.Struct(">I")

_WRIST = [[1.0, 0.0, 0.0, 0.25], [0.0, 1.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.15], [0.0, 0.0, 0.0, 1.0]]


def _request(n: int = 14) -> bytes:
    """A valid solve, so that a flood of it costs the service what it costs it with honest clients."""
    right = [[*row] for row in _WRIST]
    right[1][3] = -right[1][3]
    zeros = [0.0] * n
    return json.dumps({"left_wrist": _WRIST, "right_wrist": right, "q": zeros, "dq": zeros}).encode()


REQUEST = encode_frame(_request())


class Villain:
    """What all of them need: a connection, a random source, and counters.

    Attributes:
        counts: Connections, closings by the service, bytes sent and received.
    """

    def __init__(self, address: tuple[str, int], rng: random.Random, counts: Counter[str]) -> None:
        """Connect later."""
        self.address = address
        self.rng = rng
        self.counts = counts
        self.connected = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._socket = socket.socket()

    async def run(self, misbehave: "Callable[[Villain], Awaitable[None]]") -> None:
        """Misbehave until cancelled."""
        while True:
            self._socket = socket.socket()
            self._socket.setblocking(False)
            # Small buffers: what is not read soon fills the service's memory instead of the kernel's.
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            try:
                await self._loop.sock_connect(self._socket, self.address)
                self.counts["connections"] += 1
                self.connected.set()
                await misbehave(self)
            except OSError:
                self.counts["closed by the service"] += 1
                await asyncio.sleep(_RETRY_S)
            finally:
                self._socket.close()

    async def send(self, data: bytes) -> None:
        """Send all of it, when the service takes it."""
        await self._loop.sock_sendall(self._socket, data)
        self.counts["bytes sent"] += len(data)

    async def receive(self, count: int = _RECEIVE_BYTES) -> bytes:
        """Read what there is; raises where the service has closed."""
        data = await self._loop.sock_recv(self._socket, count)
        if not data:
            raise ConnectionResetError
        self.counts["bytes received"] += len(data)
        return data


async def slow_reader(villain: Villain) -> None:
    """Asks as fast as it can and reads a byte a second of the answers."""

    async def read() -> None:
        while True:
            await villain.receive(1)
            await asyncio.sleep(1.0)

    async def write() -> None:
        while True:
            await villain.send(REQUEST * FRAMES_A_WRITE)

    await _both(read(), write())


async def slow_writer(villain: Villain) -> None:
    """Sends a request a byte a second."""

    async def write() -> None:
        for byte in REQUEST:
            await villain.send(bytes((byte,)))
            await asyncio.sleep(1.0)

    await _both(_read_on(villain), write())


async def flood(villain: Villain) -> None:
    """Pipelines requests as fast as the service takes them, and reads all answers."""

    async def write() -> None:
        while True:
            await villain.send(REQUEST * FRAMES_A_WRITE)

    await _both(_read_on(villain), write())


async def junk(villain: Villain) -> None:
    """Sends bytes that mean nothing, framed and unframed, as fast as they are answered."""
    rng = villain.rng
    noise = rng.randbytes(rng.randrange(1, 2000))
    while True:
        await villain.send(
            rng.choice(
                (
                    encode_frame(noise),
                    encode_frame(b""),
                    encode_frame(b'{"left_wrist": ' + b"[" * 500),
                    encode_frame(REQUEST[4:-20]),
                    _LENGTH.pack(0xFFFFFFFF) + noise,
                    noise,
                )
            )
        )
        await villain.receive()


async def _read_on(villain: Villain) -> None:
    while True:
        await villain.receive()


async def _both(*doings: Awaitable[None]) -> None:
    """Do all at once, until one fails."""
    tasks = [asyncio.ensure_future(doing) for doing in doings]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


KINDS: dict[str, Callable[[Villain], Awaitable[None]]] = {
    "slow readers": slow_reader,
    "slow writers": slow_writer,
    "junk senders": junk,
    "floods": flood,
}


async def misbehave(address: tuple[str, int], each: int, seed: int) -> dict[str, Counter[str]]:
    """Run all kinds until standard input ends.

    Args:
        address: Host and port of the service.
        each: How many of each kind.
        seed: Decides the junk.

    Returns:
        The counters of each kind.
    """
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    villains = [
        (Villain(address, random.Random(f"{seed} {kind} {k}"), counts[kind]), KINDS[kind])
        for k in range(each)
        for kind in KINDS
    ]
    tasks = [asyncio.create_task(villain.run(doing)) for villain, doing in villains]
    await asyncio.gather(*(villain.connected.wait() for villain, _ in villains))
    print("ready", flush=True)
    await _input_ends()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return counts


async def _input_ends() -> None:
    end = asyncio.Event()
    loop = asyncio.get_running_loop()
    loop.add_reader(sys.stdin.fileno(), end.set)
    await end.wait()
    loop.remove_reader(sys.stdin.fileno())


def main() -> None:
    """Run the process."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("host")
    parser.add_argument("port", type=int)
    parser.add_argument("--each", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    counts = uvloop.run(misbehave((options.host, options.port), options.each, options.seed))
    print(json.dumps(counts), flush=True)


if __name__ == "__main__":
    main()
