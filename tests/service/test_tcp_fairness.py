"""`TcpServer` under clients that ask too much: turns, streams, rates, junk, and places. Hazard row: slowloris / flood.

Each test runs on both event loops. Limits and clocks are injected.
"""

import asyncio
import json
import os
import socket
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tcp_tools import LIMIT_S, Echo, Later, Run, connect, echo_server, is_served, read_to_the_end, receive, until

from ik_proto import encode_frame


def frames(*bodies: bytes) -> bytes:
    return b"".join(map(encode_frame, bodies))


class Clock:
    """Time that stands still until it is moved [s]."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


async def most_in_one_turn(done: Callable[[], int], until_done: int) -> int:
    """The largest number of answers made between two turns of the event loop."""
    most, before = 0, done()
    while done() < until_done:
        await asyncio.sleep(0)
        most, before = max(most, done() - before), done()
    return most


def test_a_connection_gets_one_answer_a_turn(run: Run) -> None:
    """Hazard row: slowloris / flood."""

    async def main() -> None:
        echo = Echo()
        async with echo_server(echo) as (_, address):
            reader, writer = await connect(address)
            writer.write(frames(*[b"flood"] * 300))
            # One of those that wait, and one of a read that comes when none waits any more.
            assert await most_in_one_turn(lambda: len(echo.arrived), 300) <= 2
            assert [await receive(reader) for _ in range(300)] == [b"echo flood"] * 300
            writer.close()

    run(main())


def test_who_asks_little_waits_for_one_answer_to_those_who_ask_much(run: Run) -> None:
    """Hazard row: slowloris / flood."""

    async def main() -> None:
        echo = Echo()
        async with echo_server(echo) as (server, address):
            floods = [await connect(address) for _ in range(20)]
            reader, writer = await connect(address)
            await until(lambda: server.connections == 21)
            for _, flood in floods:
                flood.write(frames(*[b"flood"] * 100))
            await until(lambda: len(echo.arrived) > 100)
            for _ in range(10):
                before = len(echo.arrived)
                os.write(writer.get_extra_info("socket").fileno(), encode_frame(b"alone"))
                assert await receive(reader) == b"echo alone"
                assert len(echo.arrived) - before <= 8  # turns of the loop that this client itself takes, too
            assert len(echo.arrived) < 20 * 100
            for other, flood in floods:
                assert [await receive(other) for _ in range(100)] == [b"echo flood"] * 100
                flood.close()
            writer.close()

    run(main())


def test_of_a_stream_that_piled_up_only_the_newest_is_answered_with_work(run: Run) -> None:
    """Hazard row: stale target."""

    async def main() -> None:
        echo = Echo()
        async with echo_server(echo) as (_, address):
            reader, writer = await connect(address)
            writer.write(frames(*[b"arms/%d" % k for k in range(100)], b"plain", b"plain"))
            answers = [await receive(reader) for _ in range(102)]
            assert answers[:99] == [b"superseded arms/%d" % k for k in range(99)]
            assert answers[99:] == [b"echo arms/99", b"echo plain", b"echo plain"]
            assert len(echo.arrived) == 3
            for k in range(3):  # one at a time, none is superseded
                writer.write(encode_frame(b"arms/%d" % k))
                assert await receive(reader) == b"echo arms/%d" % k
            writer.close()

    run(main())


def test_what_waits_for_the_worker_is_superseded_by_a_newer_one(run: Run) -> None:
    """Hazard row: stale target."""

    async def main() -> None:
        later = Later()
        async with echo_server(later) as (_, address):
            reader, writer = await connect(address)
            writer.write(encode_frame(b"later/1"))
            await until(lambda: len(later.coming) == 1)
            writer.write(frames(b"other/1", b"later/2"))
            assert await receive(reader) == b"superseded later/1"
            assert await receive(reader) == b"echo other/1"
            await until(lambda: len(later.coming) == 2)
            later.give(1)
            assert await receive(reader) == b"echo later/2"
            writer.close()

    run(main())


asked = st.lists(
    st.sampled_from([b"plain", b"a/%d", b"b/%d", b"later", b"later/%d", b"fault", b"x" * 20_000]), max_size=25
)


@settings(max_examples=25)
@given(kinds=asked, data=st.data())
def test_every_request_gets_exactly_one_answer_in_order(kinds: list[bytes], data: st.DataObject) -> None:
    """Hazard row: slowloris / flood; whatever is pipelined, in whatever pieces, and whenever late answers come."""
    bodies = [kind % k if b"%d" in kind else kind for k, kind in enumerate(kinds)]
    stream = frames(*bodies)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=5)))
    waiting_requests = data.draw(st.integers(1, 4))

    async def main() -> None:
        later = Later()
        async with echo_server(later, waiting_requests=waiting_requests) as (_, address):
            reader, writer = await connect(address)
            answers = asyncio.create_task(_receive_all(reader, len(bodies)))
            for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
                writer.write(stream[begin:end])
                await asyncio.sleep(0)
            while not answers.done():
                for index, (_, reply) in enumerate(later.coming):
                    if not reply.done():
                        later.give(index)
                await asyncio.sleep(0)
            for k, (body, answer) in enumerate(zip(bodies, await answers, strict=True)):
                name = later.stream_of(body)
                if body == b"fault":
                    assert json.loads(answer)["status"] == "internal"
                elif answer != b"echo " + body:
                    assert answer == b"superseded " + body
                    assert name
                    assert name in [later.stream_of(newer) for newer in bodies[k + 1 :]]
            writer.write_eof()
            assert await read_to_the_end(reader) == b""
            writer.close()

    with asyncio.Runner() as runner:
        runner.run(asyncio.wait_for(main(), LIMIT_S))


async def _receive_all(reader: asyncio.StreamReader, count: int) -> list[bytes]:
    return [await receive(reader) for _ in range(count)]


def test_who_asks_too_often_is_answered_at_its_rate_and_loses_nothing(run: Run) -> None:
    """Hazard row: slowloris / flood."""

    async def main() -> None:
        clock, echo = Clock(), Echo()
        async with echo_server(echo, clock, requests_per_s=1000.0, burst=5) as (_, address):
            reader, writer = await connect(address)
            writer.write(frames(*[b"flood"] * 30))
            assert [await receive(reader) for _ in range(5)] == [b"echo flood"] * 5
            assert await is_served(address)  # others are not concerned
            assert await is_served(address)
            assert len(echo.arrived) == 5 + 2
            clock.now += 0.0101
            assert [await receive(reader) for _ in range(5)] == [b"echo flood"] * 5  # no more than a burst at once
            assert await is_served(address)
            assert len(echo.arrived) == 10 + 3
            for _ in range(4):
                clock.now += 0.0051
                assert [await receive(reader) for _ in range(5)] == [b"echo flood"] * 5
            writer.close()

    run(main())


def test_a_flood_is_read_no_faster_than_it_is_answered(run: Run) -> None:
    """Hazard row: slowloris / flood."""

    async def main() -> None:
        clock = Clock()
        async with echo_server(clock=clock, requests_per_s=1e6, burst=1, waiting_requests=8) as (_, address):
            reader, writer = await connect(address)
            flood = asyncio.create_task(_write(writer, encode_frame(b"z" * 60_000), 400))
            done, _ = await asyncio.wait([flood], timeout=0.3)
            assert not done  # 24 MB do not fit into the buffers between the two
            assert await is_served(address)
            for _ in range(400):
                clock.now += 1e-5
                assert len(await receive(reader)) == 60_005
            await flood
            writer.close()

    run(main())


async def _write(writer: asyncio.StreamWriter, frame: bytes, count: int) -> None:
    for _ in range(count):
        writer.write(frame)
        await writer.drain()


def test_requests_of_one_wake_up_arrived_together(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hazard row: loop overrun; waiting for other connections counts."""

    async def main() -> None:
        clock, echo = Clock(), Echo()
        slow_answer = echo.answer

        def answer(body: bytes, arrived: float):
            clock.now += 0.02
            return slow_answer(body, arrived)

        monkeypatch.setattr(echo, "answer", answer)
        async with echo_server(echo, clock) as (server, address):
            clients = [await connect(address) for _ in range(3)]
            await until(lambda: server.connections == 3)
            for _, writer in clients:
                os.write(writer.get_extra_info("socket").fileno(), encode_frame(b"now"))  # all before the loop looks
            for reader, _ in clients:
                await receive(reader)
            assert echo.arrived == [100.0] * 3
            for _, writer in clients:
                writer.close()

    run(main())


def test_many_undecodable_bodies_in_a_row_close_the_connection_after_the_answer(run: Run) -> None:
    """Hazard row: malformed frame."""

    async def main() -> None:
        async with echo_server(hopeless_bodies=4) as (server, address):
            reader, writer = await connect(address)
            writer.write(frames(*([b"junk"] * 3 + [b"good"]) * 2))
            assert [await receive(reader) for _ in range(8)] == [*[b"echo junk"] * 3, b"echo good"] * 2
            writer.write(frames(*[b"junk"] * 6))
            assert await read_to_the_end(reader) == frames(*[b"echo junk"] * 4)
            assert server.closed["hopeless bodies"] == 1
            assert await is_served(address)
            writer.close()

    run(main())


def test_who_only_listens_any_more_gets_all_its_answers(run: Run) -> None:
    async def main() -> None:
        async with echo_server() as (_, address):
            reader, writer = await connect(address)
            writer.write(frames(*[b"last words"] * 50))
            writer.write_eof()
            assert await read_to_the_end(reader) == frames(*[b"echo last words"] * 50)
            writer.close()

    run(main())


def test_a_silent_connection_makes_place_when_all_are_taken(run: Run) -> None:
    """Hazard row: slowloris / flood."""

    async def main() -> None:
        clock, later = Clock(), Later()
        async with echo_server(later, clock, connections=3, silent_s=60.0) as (server, address):
            busy, quiet, talking = [await connect(address) for _ in range(3)]
            busy[1].write(encode_frame(b"later"))
            await until(lambda: len(later.coming) == 1)
            for reader, writer in (quiet, talking):
                writer.write(encode_frame(b"hello"))
                await receive(reader)
            clock.now += 59.0
            talking[1].write(encode_frame(b"hello"))
            await receive(talking[0])
            reader, writer = await connect(address)
            assert json.loads(await receive(reader))["status"] == "overloaded"
            writer.close()
            clock.now += 2.0
            assert await is_served(address)
            assert await read_to_the_end(quiet[0]) == b""
            assert server.closed["silent"] == 1
            talking[1].write(encode_frame(b"still here"))
            assert await receive(talking[0]) == b"echo still here"
            later.give(0)
            assert await receive(busy[0]) == b"echo later"
            for _, writer in (busy, quiet, talking):
                writer.close()

    run(main())


def test_who_never_asked_makes_place_sooner_and_stays_where_there_is_place(run: Run) -> None:
    """Hazard row: slowloris / flood."""

    async def main() -> None:
        clock = Clock()
        async with echo_server(clock=clock, connections=1, first_frame_s=2.0) as (server, address):
            reader, writer = await connect(address)
            await until(lambda: server.connections == 1)
            clock.now += 1.9
            refused_reader, refused_writer = await connect(address)
            assert json.loads(await receive(refused_reader))["status"] == "overloaded"
            refused_writer.close()
            clock.now += 600.0
            writer.write(encode_frame(b"after ten minutes"))
            assert await receive(reader) == b"echo after ten minutes"
            await until(lambda: server.connections == 1)
            writer.close()
            await until(lambda: server.connections == 0)
            reader, writer = await connect(address)
            await until(lambda: server.connections == 1)
            clock.now += 2.1
            assert await is_served(address)
            assert await read_to_the_end(reader) == b""
            writer.close()

    run(main())


def test_the_system_asks_whether_the_other_end_lives(run: Run) -> None:
    """Hazard row: lost connection."""

    async def main() -> None:
        async with echo_server(keepalive_s=15) as (server, address):
            _, writer = await connect(address)
            await until(lambda: server.connections == 1)
            (connection,) = server._connections
            assert connection._socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
            if hasattr(socket, "TCP_KEEPIDLE"):
                assert connection._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 15
            writer.close()

    run(main())


def test_a_log_is_not_filled_by_who_comes_back(run: Run, caplog: pytest.LogCaptureFixture) -> None:
    """Hazard row: slowloris / flood."""

    async def main() -> None:
        clock = Clock()
        async with echo_server(clock=clock, hopeless_bodies=1) as (server, address):
            for _ in range(5):
                reader, writer = await connect(address)
                writer.write(encode_frame(b"junk"))
                await read_to_the_end(reader)
                writer.close()
            assert server.closed["hopeless bodies"] == 5
            assert len([record for record in caplog.records if record.message == "connection closed"]) == 1

    run(main())
