"""Pictures drawn beforehand, shown to whoever wants one: the way of a picture without what drawing it costs."""

import os
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace

from ik_client.eyes import open_eyes, open_publisher

RATE = 30.0
"""Most pictures a second."""

_PAGES, _PATIENCE_S, _POLL_S = 8, 20.0, 0.001


@contextmanager
def album(eyes: str, robot: str) -> Generator[str]:
    """Take some pictures, then show them over and over, each as if it were taken when it is shown.

    Args:
        eyes: Where the robot shows what its eyes see.
        robot: Its name.

    Yields:
        Where the pictures are shown.

    Raises:
        RuntimeError: The robot shows nothing.
    """
    frames = []
    with open_eyes(eyes, robot) as source:
        while len(frames) < _PAGES:
            frame = source.wait(frames[-1].seq if frames else -1, _PATIENCE_S)
            if frame is None:
                raise RuntimeError("the robot shows nothing")
            frames.append(frame)
    url = f"shm:ik-eyes-album-{os.getpid()}"
    publisher, ended = open_publisher(url, robot), threading.Event()

    def show() -> None:
        number, due = 0, 0.0
        while not ended.wait(_POLL_S):
            now = time.monotonic()
            if now >= due and publisher.wanted:
                number, due = number + 1, now + 1.0 / RATE
                publisher.publish(replace(frames[number % _PAGES], seq=number, taken_ms=1e3 * now))

    thread = threading.Thread(target=show, name="album", daemon=True)
    thread.start()
    try:
        yield url
    finally:
        ended.set()
        thread.join()
        publisher.close()
