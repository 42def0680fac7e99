"""What the robot's end of the link asks of its peers, and what it puts up with."""

import json
import socket
import ssl
import struct

import pytest
import trustme
from link_bench import TOKEN, WELCOME, N, Raw, Robot, command, document, state, wait_for

from ik_client.robot_end import LinkLimits, LinkServer, RobotLink, RobotSilent
from ik_proto.robot_link import MAX_LINK_FRAME_BYTES


@pytest.fixture
def start():
    robots = []

    def start(**options) -> Robot:
        robots.append(Robot(**options))
        return robots[-1]

    yield start
    for robot in robots:
        robot.stop()


@pytest.mark.parametrize("token", ["", "wrong", TOKEN + "x"])
def test_a_wrong_token_is_refused(start, token):
    """Hazard row "auth", at the robot."""
    robot = start(token=TOKEN)
    with Raw(robot) as raw:
        raw.send({"v": 1, "token": token})
        assert raw.receive() == {"error": "unauthorized: the robot demands a token, and this is not it"}
        assert raw.closed()
    assert not robot.arrivals


def test_a_token_without_bytes_is_a_wrong_one():
    assert not LinkServer(WELCOME, token=TOKEN).admits("\ud800")


def test_the_right_token_comes_from_the_environment(start, monkeypatch):
    robot = start(token=TOKEN)
    monkeypatch.setenv("IK_TOKEN", TOKEN)
    with RobotLink(robot.url) as link:
        link.send(command(1))
        wait_for(lambda: robot.arrivals)
    monkeypatch.setenv("IK_TOKEN", "wrong")
    with pytest.raises(RobotSilent, match="unauthorized"):
        RobotLink(robot.url, connect_timeout=0.3)


def test_commands_before_the_hello_are_refused(start):
    robot = start()
    with Raw(robot) as raw:
        raw.send(document())
        assert "hello" in raw.receive()["error"]
        assert raw.closed()
    assert not robot.arrivals


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"q": [float("nan")] * N}, "not finite"),
        ({"q": [0.0] * (N + 1)}, "shape"),
        ({"engaged": "yes"}, "true or false"),
        ({"tau": None}, "tau is missing"),
    ],
)
def test_what_is_no_command_is_dropped_and_its_sender_is_told(start, changes, words):
    """Hazard rows "NaN / Inf" and "malformed frame", at the robot."""
    robot = start()
    with Raw(robot) as raw:
        raw.send({"v": 1})
        raw.receive()
        raw.send(document(1, **changes))
        while not (note := raw.receive()["note"]):
            pass
        assert note.startswith("the last command was dropped")
        assert words in note
        raw.send(document(2))
        while raw.receive()["note"]:
            pass
    assert [arrival.command.seq for arrival in robot.arrivals] == [2]
    assert robot.server.tally["bad messages"] == 1


def test_junk_is_counted_and_harms_nobody(start):
    """Hazard row "malformed frame", at the robot: another loop goes on as if nothing were."""
    robot = start()
    with RobotLink(robot.url) as link, Raw(robot) as raw:
        raw.send({"v": 1})
        for body in (b"", b"\xff\xfe", b"[]", b"null", b"[" * 1000, b'{"q": 1}'):
            raw.send_bytes(body)
        wait_for(lambda: robot.server.tally["bad messages"] == 6)
        link.send(command(1))
        wait_for(lambda: robot.arrivals)
        link.read()


def test_a_frame_that_is_too_long_ends_the_connection(start):
    """Hazard row "oversized frame", at the robot: the length alone, before a byte of the body."""
    robot = start()
    with Raw(robot) as raw:
        raw.send({"v": 1})
        raw.receive()
        raw.socket.sendall(struct.pack(">I", MAX_LINK_FRAME_BYTES + 1))
        assert raw.closed()


def test_who_says_no_hello_is_dropped(start):
    """Hazard row "slowloris / flood", at the robot."""
    robot = start(limits=LinkLimits(hello_s=0.1))
    with Raw(robot) as raw:
        raw.socket.sendall(b"\0")
        assert raw.closed()
    wait_for(lambda: robot.server.tally["dropped connections"] == 1)


def test_who_does_not_read_is_dropped(start):
    """Hazard row "slowloris / flood", at the robot."""
    robot = start(limits=LinkLimits(unread_s=0.1))
    robot.state = state(note="x" * 10_000)
    with Raw(robot) as raw, RobotLink(robot.url) as link:
        raw.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        raw.send({"v": 1})
        wait_for(lambda: robot.server.tally["dropped connections"] == 1)
        link.read()


def test_a_fifth_connection_is_told_that_there_is_no_room(start):
    robot = start()
    raws = [Raw(robot) for _ in range(4)]
    for raw in raws:
        raw.send({"v": 1})
        raw.receive()
    with Raw(robot) as fifth:
        assert "no more connections" in fifth.receive()["error"]
        assert fifth.closed()
    raws[0].socket.close()
    wait_for(lambda: len(robot.server._connections) == 3)
    with RobotLink(robot.url) as link:
        link.read()
    for raw in raws:
        raw.socket.close()


def test_of_a_flood_only_the_newest_few_are_looked_at(start):
    """Hazard row "slowloris / flood", at the robot."""
    robot = start()
    with Raw(robot) as raw:
        raw.send({"v": 1})
        raw.receive()
        body = [json.dumps(document(seq)).encode() for seq in range(2000)]
        raw.socket.sendall(b"".join(struct.pack(">I", len(part)) + part for part in body))
        wait_for(lambda: robot.arrivals and robot.arrivals[-1].command.seq == 1999)
    assert len(robot.arrivals) < 2000


def test_tls_and_client_certificates(start, tmp_path):
    ca = trustme.CA()
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    ca.issue_cert("127.0.0.1").configure_cert(server)
    server.verify_mode = ssl.CERT_REQUIRED
    ca.configure_trust(server)
    robot = start(ssl=server)
    client = ssl.create_default_context()
    ca.configure_trust(client)
    url = robot.url.replace("tcp", "tls")
    with pytest.raises(RobotSilent):
        RobotLink(url, ssl=client, connect_timeout=0.3)
    ca.issue_cert("loop@example.org").configure_cert(client)
    with RobotLink(url, ssl=client) as link:
        link.send(command(1))
        wait_for(lambda: robot.arrivals)
        link.read()
