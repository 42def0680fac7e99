"""A stand-in for the service: real sockets and the real contract, no kinematics, and faults on demand."""

import contextlib
import json
import socket
import ssl
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from ik_proto import (
    JSON,
    MSGPACK,
    BatchReply,
    Codec,
    FkReply,
    FkRequest,
    FrameDecoder,
    InfoReply,
    InfoRequest,
    Reply,
    Request,
    RequestError,
    SolveBatchRequest,
    SolveReply,
    Status,
    encode_frame,
    parse_request,
    reply_document,
)

JOINTS = 14
LOWER, UPPER = np.full(JOINTS, -2.0), np.full(JOINTS, 2.0)
SHOULDERS = np.array([[0.0, 0.1, 0.3], [0.0, -0.1, 0.3]])
EYE = np.eye(4)
Q = np.linspace(-0.5, 0.5, JOINTS)
OPTIONS: dict[str, Any] = {
    "mode": "reach",
    "waist": np.array([0.1, -0.2, 0.3]),
    "left_elbow": np.array([0.0, 0.6, -0.8, 0.5]),
    "right_elbow": np.array([0.0, -1.0, 0.0, 1.0]),
    "weights": np.array([[1.0, 0.5], [0.25, 0.0]]),
    "collision": "report",
    "starts": 7,
}
"""Every option of a solve, and none with its default."""
DEFAULTS: dict[str, Any] = dict.fromkeys(OPTIONS) | {"mode": "track", "starts": 128}


class FakeService:
    """Answers one request at a time from whatever thread carries it; behaviour is exchanged by setting `answer`."""

    def __init__(self, boot_id: str = "boot-1") -> None:
        self.boot_id = boot_id
        self.requests: list[Request] = []
        self.documents: list[dict[str, Any]] = []
        """The requests as they came, envelope and all."""
        self.answer: Callable[[Request], Reply | bytes | None] = self.reply
        """Gives a reply, raw bytes to send instead of one, or None to close the connection."""
        self.frame: Callable[[bytes], bytes] = encode_frame
        """How a body is put on the stream."""

    def reply(self, request: Request) -> Reply:
        """What a healthy service says: it solves by moving every joint by 0.1 rad, up to its limit."""
        head: dict[str, Any] = {
            "success": True,
            "error": "",
            "status": Status.OK,
            "id": request.id,
            "boot_id": self.boot_id,
        }
        match request:
            case InfoRequest():
                return InfoReply(
                    **head,
                    protocol=1,
                    version="0",
                    robot="fake",
                    model_hash="0",
                    joint_names=[f"joint_{i}" for i in range(JOINTS)],
                    lower=LOWER,
                    upper=UPPER,
                    velocity=np.full(JOINTS, 10.0),
                    shoulders=SHOULDERS,
                    reach=np.array([0.5, 0.5]),
                    presets=["openwbt"],
                    default_preset="openwbt",
                    kernel="vm",
                    waist_joints=["waist_yaw", "waist_roll", "waist_pitch"],
                    margin=0.01,
                    capsules=["torso", "left_hand"],
                )
            case SolveBatchRequest():
                rows = len(request.q)
                return BatchReply(
                    **head,
                    sol_q=np.minimum(request.q + 0.1, UPPER),
                    statuses=[Status.OK] * rows,
                    tau=np.ones((rows, JOINTS)),
                    position_error=np.zeros((rows, 2)),
                    rotation_error=np.zeros((rows, 2)),
                    clearance=np.full(rows, 0.25),
                    start=[0] * rows,
                    iterations=3 * rows,
                    solve_us=7.0 * rows,
                    server_us=9.0 * rows,
                )
            case FkRequest():
                return FkReply(**head, left_wrist=pose(request.q[:3]), right_wrist=pose(request.q[7:10]))
            case _:
                return SolveReply(
                    **head,
                    sol_q=np.minimum(request.q + 0.1, UPPER),
                    tau=np.ones(JOINTS),
                    position_error=np.zeros(2),
                    rotation_error=np.zeros(2),
                    iterations=3,
                    solve_us=7.0,
                    server_us=9.0,
                )

    def refuse(self, request: Request, status: Status, message: str = "no") -> Reply:
        return SolveReply(success=False, error=message, status=status, id=request.id, boot_id=self.boot_id)

    def respond(self, body: bytes, codec: Codec) -> bytes | None:
        document = codec.decode(body)
        try:
            request = parse_request(document, JOINTS)
        except RequestError as error:
            reply = SolveReply(success=False, error=str(error), status=error.status, id=error.id, boot_id=self.boot_id)
            return codec.encode(reply_document(reply))
        self.requests.append(request)
        self.documents.append(document)
        said = self.answer(request)
        return codec.encode(reply_document(said)) if isinstance(said, Reply) else said


class TcpFake:
    """A `FakeService` behind a socket, with TLS where it is given a context."""

    def __init__(self, service: FakeService, port: int = 0, tls: ssl.SSLContext | None = None) -> None:
        self.service = service
        self._tls = tls
        self.accepted = 0
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self.url = f"{'tls' if tls else 'tcp'}://127.0.0.1:{self.port}"
        self._connections: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                self.accepted += 1
                self._connections.append(connection)
                thread = threading.Thread(target=self._serve, args=(connection,))
                self._threads.append(thread)
                thread.start()

    def _serve(self, connection: socket.socket) -> None:
        decoder = FrameDecoder()
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            stack.enter_context(connection)
            if self._tls is not None:
                connection = stack.enter_context(self._tls.wrap_socket(connection, server_side=True))
                self._connections.append(connection)
            while data := connection.recv(65536):
                for body in decoder.feed(data):
                    said = self.service.respond(body, JSON)
                    if said is None:
                        return
                    connection.sendall(self.service.frame(said))

    def stop(self) -> None:
        """Die as a killed process does: all sockets closed at once."""
        for end in [self._listener, *self._connections]:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        for thread in self._threads:
            thread.join(5.0)


class ZenohFake:
    """A `FakeService` as a Zenoh replica, listening by itself."""

    def __init__(self, service: FakeService, endpoint: str, *, listen: bool = True, robot: str = "fake") -> None:
        import zenoh

        config = zenoh.Config()
        for path, value in {
            "mode": "peer" if listen else "client",
            "listen/endpoints": [endpoint] if listen else [],
            "connect/endpoints": [] if listen else [endpoint],
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
            "transport/shared_memory/enabled": False,
        }.items():
            config.insert_json5(path, json.dumps(value))
        self.service = service
        self._session = zenoh.open(config)
        key = f"ik/{robot}/rpc/{service.boot_id}"
        self._queries = self._session.declare_queryable(key, zenoh.handlers.FifoChannel(64), complete=True)
        self._token = self._session.liveliness().declare_token(f"ik/{robot}/alive/{service.boot_id}")
        self._thread = threading.Thread(target=self._pump)
        self._thread.start()

    def _pump(self) -> None:
        import zenoh

        with contextlib.suppress(zenoh.ZError):
            for query in self._queries:
                with query:
                    said = self.service.respond(bytes(query.payload or b""), MSGPACK)
                    if said is not None:
                        query.reply(query.key_expr, said)

    def stop(self) -> None:
        self._session.close()
        self._thread.join(5.0)


def pose(xyz: np.ndarray) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = xyz
    return T


def bent(entry: tuple[int, int], value: float) -> np.ndarray:
    T = np.eye(4)
    T[entry] = value
    return T


def reply_with(reply: SolveReply, **changes: object) -> bytes:
    return JSON.encode(reply_document(reply) | changes)


class Echo:
    """A transport that always says the same."""

    codec = JSON
    shows_token = False

    def __init__(self, said: bytes) -> None:
        self.said = said

    def request(self, body: bytes, deadline: float) -> bytes:
        return self.said

    def reset(self) -> None:
        pass

    def close(self) -> None:
        pass
