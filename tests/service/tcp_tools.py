"""A `TcpServer` that echoes, and what talks to it."""

import asyncio
import json
import struct
import threading
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from contextlib import asynccontextmanager
from typing import Any

from ik_proto import Status, encode_frame
from ik_service.addresses import HostPort
from ik_service.tcp_server import Answer, TcpLimits, TcpServer

LIMIT_S = 10.0
Run = Callable[[Coroutine[Any, Any, None]], None]


def refuse(status: Status, message: str) -> bytes:
    return json.dumps({"status": status.value, "error_msg": message}).encode()


class Later:
    """Echoes at once, but for bodies that begin with "later": their answers come when the test says."""

    def __init__(self) -> None:
        self.coming: list[tuple[bytes, Future[bytes]]] = []

    def __call__(self, body: bytes) -> bytes | Future[bytes]:
        if not body.startswith(b"later"):
            return b"echo " + body
        self.coming.append((body, Future()))
        return self.coming[-1][1]

    def answer(self, index: int) -> None:
        """Give an answer, from another thread."""
        body, reply = self.coming[index]
        assert reply.set_running_or_notify_cancel()
        thread = threading.Thread(target=reply.set_result, args=(b"echo " + body,))
        thread.start()
        thread.join()


@asynccontextmanager
async def echo_server(answer: Answer = lambda body: b"echo " + body, **limits: Any):
    server = TcpServer(lambda: answer, refuse, TcpLimits(**limits))
    address = await server.start(HostPort("127.0.0.1", 0))
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
