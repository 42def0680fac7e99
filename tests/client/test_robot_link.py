"""The link, over real sockets: latest wins both ways, and whatever the other end does, nobody waits for it."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from link_bench import LIMIT, WELCOME, Raw, Robot, command, state, wait_for

from ik_client import WristMotion
from ik_client.robot_end import RobotLink, RobotSilent
from ik_client.robot_end.link import SILENT_AFTER


@pytest.fixture
def start():
    robots = []

    def start(**options) -> Robot:
        robots.append(Robot(**options))
        return robots[-1]

    yield start
    for robot in robots:
        robot.stop()


def test_states_and_commands_travel(start):
    robot = start()
    robot.state = state(weight=0.5, note="a note", q=0.25)
    with RobotLink(robot.url) as link:
        assert link.welcome == WELCOME
        wait_for(lambda: link.weight == 0.5)
        seen = link.read()
        np.testing.assert_array_equal(seen.q, [0.25, 0.25])
        assert (seen.note, seen.ready) == ("a note", False)
        begin = time.monotonic()
        link.send(command(1, engaged=True, boot_id="b"))
        wait_for(lambda: robot.arrivals)
        arrival = robot.arrivals[0]
        assert (arrival.command.session, arrival.command.seq, arrival.command.boot_id) == ("s", 1, "b")
        assert arrival.command.engaged
        assert begin <= arrival.time <= time.monotonic()


def test_a_motion_travels_beside_a_command(start):
    """And is forgotten when the arms are given back: a loop that ends drives nothing."""
    robot = start()
    robot.state = state(weight=0.0)
    motion = WristMotion(np.ones((2, 6)), 0.5 * np.ones((2, 6)), np.array([0.1, 0.2]), ("", "speed"), (None, "a"))
    with RobotLink(robot.url) as link:
        link.send(replace(command(1), motion=motion))
        wait_for(lambda: robot.arrivals)
        seen = robot.arrivals[0].command.motion
        np.testing.assert_array_equal(seen.achieved, motion.achieved)
        assert (seen.limited_by, seen.limiting_joint) == (("", "speed"), (None, "a"))
        assert link.release(LIMIT)
        wait_for(lambda: robot.arrivals[-1].command.release)  # The robot had nothing to give back, and said so before.
    assert robot.arrivals[-1].command.release
    assert robot.arrivals[-1].command.motion is None


def test_states_carry_the_time_of_their_arrival(start):
    """Hazard row "clock skew": the robot's own time, 5 s, is not the loop's."""
    with RobotLink(start().url) as link:
        assert abs(link.read().time - time.monotonic()) < 1.0


def test_a_robot_that_says_nothing_more_is_silent(start):
    """Hazard row "lost connection", at the loop."""
    robot = start()
    with RobotLink(robot.url) as link:
        link.read()
        robot.silent = True

        def silent() -> bool:
            try:
                link.read()
            except RobotSilent:
                return True
            return False

        wait_for(silent)
        robot.silent = False
        wait_for(lambda: not silent())


def test_the_age_of_a_state_is_what_counts(start):
    robot = start()
    now = [time.monotonic()]
    with RobotLink(robot.url, clock=lambda: now[0]) as link:
        robot.silent = True
        time.sleep(0.05)  # What is under way still comes.
        for age, fresh in ((0.9 * SILENT_AFTER, True), (1.1 * SILENT_AFTER, False), (-1.0, False)):
            assert link._latest is not None
            now[0] = link._latest[1] + age
            try:
                link.read()
            except RobotSilent as error:
                assert not fresh, error
            else:
                assert fresh


def test_nobody_there_is_one_line(free_port):
    with pytest.raises(RobotSilent) as error:
        RobotLink(f"tcp://127.0.0.1:{free_port}", connect_timeout=0.2)
    assert "nobody is there (connection refused)" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("url", ["zenoh://127.0.0.1:1", "http://127.0.0.1:1", "127.0.0.1:1", "tcp://127.0.0.1"])
def test_what_is_no_address_of_a_robot(url):
    with pytest.raises(ValueError, match="is no address"):
        RobotLink(url)


def test_a_lost_connection_is_made_again(start, free_port):
    """Hazard row "lost connection": the robot's process dies and comes back; the link finds it."""
    robot = Robot(port=free_port)
    with RobotLink(robot.url) as link:
        robot.stop()
        wait_for(lambda: link._protocol is None)
        for seq in range(5):
            link.send(command(seq))  # They go nowhere, and nobody waits for them.
        back = start(port=free_port)
        wait_for(lambda: link._protocol is not None)
        wait_for(lambda: link.read() is not None)
        link.send(command(100))
        wait_for(lambda: back.arrivals)
        assert [arrival.command.seq for arrival in back.arrivals] == [100]


def test_a_connection_that_ends_takes_nothing_back(start):
    """Hazard row "lost connection", at the robot: it is nothing but silence, and what came before it counts."""
    robot = start()
    link = RobotLink(robot.url)
    link.send(command(1, release=True))
    link.close()
    wait_for(lambda: robot.arrivals)
    link.close()  # Closing twice does no harm.


def test_sending_never_waits_and_the_latest_wins(start):
    """The robot's end stops reading: a thousand commands later the loop has lost no time, and the newest goes on."""
    robot = start()
    with RobotLink(robot.url) as link:
        server_loop = robot.server._loop._loop
        stuck, go_on = threading.Event(), threading.Event()
        server_loop.call_soon_threadsafe(lambda: (stuck.set(), go_on.wait(LIMIT)))
        assert stuck.wait(LIMIT)
        begin = time.monotonic()
        for seq in range(3000):
            link.send(command(seq))
        took = time.monotonic() - begin
        go_on.set()
        assert took < 5.0  # One that waits would wait for ever.
        wait_for(lambda: robot.arrivals and robot.arrivals[-1].command.seq == 2999)
        numbers = [arrival.command.seq for arrival in robot.arrivals]
        assert numbers == sorted(numbers)
        assert len(numbers) < 3000


def test_a_release_waits_until_the_weight_is_nothing(start):
    robot = start()
    robot.state = state(weight=1.0)

    def lower(arrival) -> None:
        if arrival.command.release:
            robot.state = state(weight=max(0.0, robot.state.weight - 0.25))

    robot.on_arrival = lower
    with RobotLink(robot.url) as link:
        wait_for(lambda: link.weight == 1.0)
        link.send(command(7, engaged=True))
        assert link.release(LIMIT)
        assert link.weight == 0.0
    releases = [arrival.command for arrival in robot.arrivals if arrival.command.release]
    assert [c.seq for c in releases] == sorted({c.seq for c in releases})
    assert {(c.session, c.engaged) for c in releases} == {("s", False)}
    assert releases[0].seq > 7


def test_a_release_that_is_not_heeded_says_so(start):
    robot = start()
    robot.state = state(weight=1.0)
    with RobotLink(robot.url) as link:
        wait_for(lambda: link.weight == 1.0)
        assert not link.release(0.1)


def test_a_busy_robot_says_so(start):
    """Hazard row "two operators", over the link: only the one who is refused is told."""
    robot = start()
    robot.busy_state = state(note="busy: another session holds the robot")

    def refuse(arrival) -> None:
        arrival.connection.busy = arrival.command.session == "s"

    robot.on_arrival = refuse
    with RobotLink(robot.url) as link, Raw(robot) as other:
        other.send({"v": 1})
        assert other.receive()["robot"] == "toy"
        link.send(command(1))
        wait_for(lambda: link.read().note.startswith("busy"))
        for _ in range(5):
            assert other.receive()["note"] == ""
