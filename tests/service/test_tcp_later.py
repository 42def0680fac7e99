"""`TcpServer` with answers that come later, from another thread: order, back-pressure, clients that leave, its end.

Each test runs on both event loops.
"""

import asyncio
import json
import struct

import pytest
from tcp_tools import LIMIT_S, Later, Run, connect, echo_server, is_served, read_to_the_end, receive, until

from ik_proto import encode_frame


def test_replies_stay_in_order_though_some_come_later(run: Run) -> None:
    async def main() -> None:
        later = Later()
        async with echo_server(later) as (_, address):
            reader, writer = await connect(address)
            bodies = [b"at once", b"later 1", b"after it", b"later 2", b"last"]
            writer.write(b"".join(map(encode_frame, bodies)))
            assert await receive(reader) == b"echo at once"
            assert await is_served(address)  # another connection does not wait
            writer.write(encode_frame(b"and one more"))
            later.give(0)
            assert [await receive(reader) for _ in range(2)] == [b"echo later 1", b"echo after it"]
            assert await is_served(address)
            later.give(1)
            assert [await receive(reader) for _ in range(3)] == [b"echo later 2", b"echo last", b"echo and one more"]
            writer.close()

    run(main())


def test_a_connection_that_awaits_an_answer_is_read_only_so_far(run: Run) -> None:
    async def main() -> None:
        later = Later()
        async with echo_server(later, waiting_bytes=10_000, unread_bytes=1 << 26) as (_, address):
            reader, writer = await connect(address)
            frame, count = encode_frame(b"z" * 60_000), 400
            writer.write(encode_frame(b"later"))
            flood = asyncio.create_task(_write(writer, frame, count))
            done, _ = await asyncio.wait([flood], timeout=0.3)
            assert not done  # 24 MB do not fit into the buffers between the two
            assert await is_served(address)
            later.give(0)
            assert await receive(reader) == b"echo later"
            for _ in range(count):
                assert len(await receive(reader)) == 60_005
            await flood
            writer.close()

    run(main())


async def _write(writer: asyncio.StreamWriter, frame: bytes, count: int) -> None:
    for _ in range(count):
        writer.write(frame)
        await writer.drain()


def test_a_frame_is_not_late_while_it_may_go_unread(run: Run) -> None:
    async def main() -> None:
        later = Later()
        async with echo_server(later, frame_s=0.05) as (_, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b"later") + encode_frame(b"next")[:6])
            # By the time that a frame which begins later is dropped, this one would have been.
            slow_reader, slow_writer = await connect(address)
            slow_writer.write(b"\x00")
            assert await read_to_the_end(slow_reader) == b""
            later.give(0)
            assert await receive(reader) == b"echo later"
            writer.write(encode_frame(b"next")[6:])
            assert await receive(reader) == b"echo next"
            writer.write(b"\x00")  # from now on it counts again
            assert await read_to_the_end(reader) == b""
            writer.close()
            slow_writer.close()

    run(main())


def test_a_fault_is_told_after_the_answers_before_it(run: Run) -> None:
    async def main() -> None:
        later = Later()
        async with echo_server(later) as (_, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b"later") + encode_frame(b"before") + struct.pack(">I", 2**32 - 1) + b"x" * 1000)
            await until(lambda: len(later.coming) == 1)
            writer.write(b"more of it")
            later.give(0)
            assert [await receive(reader) for _ in range(2)] == [b"echo later", b"echo before"]
            assert json.loads(await receive(reader))["status"] == "bad_request"
            assert await reader.read() == b""
            writer.close()

    run(main())


@pytest.mark.parametrize("begun", [False, True], ids=["waiting", "being made"])
def test_an_answer_for_a_client_that_left_is_cancelled_or_dropped(run: Run, begun: bool) -> None:
    async def main() -> None:
        later = Later()
        async with echo_server(later) as (server, address):
            _, writer = await connect(address)
            writer.write(encode_frame(b"later") + encode_frame(b"later too"))
            await until(lambda: len(later.coming) == 1)
            reply = later.coming[0][1]
            if begun:
                assert reply.set_running_or_notify_cancel()
            writer.close()
            await until(lambda: server.connections == 0)
            assert reply.cancelled() is not begun
            if begun:
                reply.set_result(b"nobody reads it")
            assert await is_served(address)
            assert len(later.coming) == 1

    run(main())


def test_an_answer_that_could_not_be_made_is_a_fault_of_ours(run: Run, caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        later = Later()
        async with echo_server(later) as (_, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b"later"))
            await until(lambda: len(later.coming) == 1)
            later.coming[0][1].set_exception(RuntimeError("a fault of ours"))
            reply = json.loads(await receive(reader))
            assert reply["status"] == "internal"
            assert "a fault of ours" not in reply["error_msg"]
            writer.write(encode_frame(b"fault") + encode_frame(b"and on"))
            assert json.loads(await receive(reader))["status"] == "internal"
            assert await receive(reader) == b"echo and on"
            writer.close()

    run(main())
    assert caplog.text.count("RuntimeError: a fault of ours") == 2


@pytest.mark.parametrize("comes", [True, False])
def test_stop_waits_a_while_for_answers_to_come_and_refuses_the_rest(run: Run, comes: bool) -> None:
    async def main() -> None:
        later = Later()
        async with echo_server(later) as (server, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b"later") + encode_frame(b"next"))
            await until(lambda: len(later.coming) == 1)
            stopping = asyncio.create_task(server.stop(grace_s=LIMIT_S if comes else 0.05))
            await asyncio.sleep(0)
            if comes:
                later.give(0)
            await stopping
            answers = [b"echo later", b"echo next"] if comes else [b"overloaded later", b"overloaded next"]
            assert await read_to_the_end(reader) == b"".join(map(encode_frame, answers))
            assert later.coming[0][1].cancelled() is not comes
            writer.close()

    run(main())
