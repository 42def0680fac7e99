"""`TcpServer` and frames that come slowly, in plain and over TLS. Hazard row: slowloris / flood.

Time is the event loop's own, moved by hand.
"""

import asyncio
import json
import socket
import ssl
import struct
from pathlib import Path

import pytest
from certificates import make_certificates
from tcp_tools import LIMIT_S, Echo, Run, connect, echo_server, is_served, read_to_the_end, receive, until

from ik_proto import encode_frame
from ik_service.tls import server_context


class MovedLoop(asyncio.SelectorEventLoop):
    """An event loop whose time can be moved on."""

    ahead_s = 0.0

    def time(self) -> float:
        return super().time() + self.ahead_s


def test_a_large_frame_may_take_longer_while_it_makes_progress() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, MovedLoop)
        ticks = iter(range(10**6))
        async with echo_server(Echo(), lambda: float(next(ticks)), frame_s=60.0, frame_bytes=1000) as (server, address):
            reader, writer = await connect(address)
            await until(lambda: server.connections == 1)
            (connection,) = server._connections
            frame = encode_frame(b"x" * 9_996)
            for begin in range(0, 9_000, 1000):
                before = connection.heard
                writer.write(frame[begin : begin + 1000])
                await until(lambda before=before: connection.heard > before)
                loop.ahead_s += 50.0
                await asyncio.sleep(0)
            writer.write(frame[9_000:])
            assert len(await receive(reader)) == len(b"echo ") + 9_996
            for step in (b"\x00", b"\x00", b"\x00"):  # a byte now and then is no progress
                before = connection.heard
                writer.write(step)
                await until(lambda before=before: connection.heard > before)
                loop.ahead_s += 25.0
                await asyncio.sleep(0)
            assert await read_to_the_end(reader) == b""
            assert server.closed["late frame"] == 1
            writer.close()

    with asyncio.Runner(loop_factory=MovedLoop) as runner:
        runner.run(asyncio.wait_for(main(), 9 * 50.0 + 3 * 25.0 + LIMIT_S))


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_certificates(tmp_path_factory.mktemp("certificates"))


@pytest.fixture
def server_tls(certificates: Path) -> ssl.SSLContext:
    return server_context(str(certificates / "service.pem"), str(certificates / "service.key"))


def test_a_handshake_that_does_not_complete_closes_the_connection(run: Run, server_tls: ssl.SSLContext) -> None:
    async def main() -> None:
        async with echo_server(ssl=server_tls, handshake_s=0.05) as (_, address):
            reader, writer = await connect(address)
            writer.write(b"\x16\x03\x01")
            assert await read_to_the_end(reader) == b""
            writer.close()

    run(main())


def test_over_tls_everything_is_as_in_plain(run: Run, server_tls: ssl.SSLContext, certificates: Path) -> None:
    async def main() -> None:
        tls = ssl.create_default_context(cafile=str(certificates / "ca.pem"))
        async with echo_server(ssl=server_tls) as (server, address):
            reader, writer = await asyncio.open_connection(address.host, address.port, ssl=tls)
            writer.write(b"".join(map(encode_frame, [b"arms/%d" % k for k in range(50)])))
            answers = [await receive(reader) for _ in range(50)]
            assert answers == [b"superseded arms/%d" % k for k in range(49)] + [b"echo arms/49"]
            (connection,) = server._connections
            assert connection._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) == 1
            writer.write(struct.pack(">I", 2**32 - 1))
            assert json.loads(await receive(reader))["status"] == "bad_request"
            assert await read_to_the_end(reader) == b""
            writer.close()
            await until(lambda: server.connections == 0)

    run(main())


def test_a_client_in_plain_on_a_tls_port_disturbs_nobody(run: Run, server_tls: ssl.SSLContext) -> None:
    async def main() -> None:
        async with echo_server(ssl=server_tls) as (_, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b'{"verb": "info"}'))
            assert b"info" not in await read_to_the_end(reader)
            writer.close()
        async with echo_server() as (_, address):
            assert await is_served(address)

    run(main())
