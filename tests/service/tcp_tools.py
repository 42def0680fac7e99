"""A `TcpServer` that echoes, and what talks to it."""

import asyncio
import json
import ssl
import struct
import threading
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from contextlib import asynccontextmanager
from typing import Any

from ik_proto import Status, encode_frame
from ik_proto.host_port import HostPort
from ik_service.tcp_server import Answerer, TcpLimits, TcpServer

LIMIT_S = 10.0
Run = Callable[[Coroutine[Any, Any, None]], None]


def refuse(status: Status, message: str) -> bytes:
    return json.dumps({"status": status.value, "error_msg": message}).encode()


class Echo:
    """An `Answerer` that echoes. A body like b"a/7" is of stream "a", b"junk" is hopeless, b"fault" raises."""

    def __init__(self) -> None:
        self.hopeless = 0
        self.arrived: list[float] = []

    def answer(self, body: bytes, arrived: float) -> bytes | Future[bytes]:
        self.arrived.append(arrived)
        self.hopeless = self.hopeless + 1 if body == b"junk" else 0
        if body == b"fault":
            raise RuntimeError("a fault of ours")
        return b"echo " + body

    def refuse(self, body: bytes, status: Status, message: str) -> bytes:
        return b"%s %s" % (status.encode(), body)

    def stream_of(self, body: bytes) -> str:
        return body.partition(b"/")[0].decode() if b"/" in body else ""

    def supersede(self, stream: str) -> None:
        pass


class Later(Echo):
    """Echoes at once, but for bodies that begin with "later": their answers come when the test says."""

    def __init__(self) -> None:
        super().__init__()
        self.coming: list[tuple[bytes, Future[bytes]]] = []

    def answer(self, body: bytes, arrived: float) -> bytes | Future[bytes]:
        if not body.startswith(b"later"):
            return super().answer(body, arrived)
        self.coming.append((body, Future()))
        return self.coming[-1][1]

    def supersede(self, stream: str) -> None:
        for body, reply in self.coming:
            if self.stream_of(body) == stream and not reply.done() and reply.set_running_or_notify_cancel():
                reply.set_result(self.refuse(body, Status.SUPERSEDED, ""))

    def give(self, index: int) -> None:
        """Give an answer, from another thread."""
        body, reply = self.coming[index]
        assert reply.set_running_or_notify_cancel()
        thread = threading.Thread(target=reply.set_result, args=(b"echo " + body,))
        thread.start()
        thread.join()


@asynccontextmanager
async def echo_server(
    answerer: Answerer | None = None,
    clock: Callable[[], float] = time.perf_counter,
    ssl: ssl.SSLContext | None = None,
    **limits: Any,
):
    server = TcpServer(lambda: answerer or Echo(), refuse, TcpLimits(**limits), clock)
    address = await server.start(HostPort("127.0.0.1", 0), ssl)
    try:
        yield server, address
    finally:
        await server.stop(grace_s=0.2)


async def connect(address: HostPort) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    return await asyncio.open_connection(address.host, address.port)


async def receive(reader: asyncio.StreamReader) -> bytes:
    (length,) = struct.unpack(">I", await reader.readexactly(4))
    return await reader.readexactly(length)


async def is_served(address: HostPort) -> bool:
    reader, writer = await connect(address)
    writer.write(encode_frame(b"hello"))
    reply = await receive(reader)
    writer.close()
    return reply == b"echo hello"


async def until(condition: Callable[[], bool]) -> None:
    while not condition():
        await asyncio.sleep(0.001)


async def read_to_the_end(reader: asyncio.StreamReader) -> bytes:
    data = b""
    try:
        while part := await reader.read(1000):
            data += part
    except ConnectionResetError:
        pass
    return data
