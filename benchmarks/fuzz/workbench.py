"""The four things that are fuzzed, by name."""

import logging

from benchmarks.fuzz.targets import Replies, Requests, Stream, Target
from ik_proto import JSON, MSGPACK, Codec
from ik_service.config import Config
from ik_service.dispatcher import Dispatcher
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service
from ik_service.worker import Worker

TARGETS: dict[str, tuple[Codec, str, bool]] = {
    "json-requests": (JSON, "requests", True),
    "msgpack-requests": (MSGPACK, "requests", False),
    "json-replies": (JSON, "replies", True),
    "msgpack-replies": (MSGPACK, "replies", False),
}
"""Codec, side, and whether the input is a stream of frames rather than one body."""


def build(name: str, kernel: str) -> Target:
    """Set a target up.

    Args:
        name: One of `TARGETS`.
        kernel: "auto" or "vm", for the service that answers requests.

    Returns:
        What takes the bytes of one input.
    """
    codec, side, framed = TARGETS[name]
    if side == "replies":
        bodies: Target = Replies(codec)
    else:
        # A fault inside the service becomes a reply; what its log says of it belongs to the crash.
        logging.basicConfig(level=logging.ERROR)
        engine = Engine.build(Config(kernel=kernel), "boot-of-fuzz", "0.0.fuzz")
        service = Service(engine, Meter("fuzz"))
        dispatcher = Dispatcher(service, service, Worker())
        bodies = Requests(codec, lambda body: dispatcher.answer(body, codec))
    return Stream(bodies) if framed else bodies
