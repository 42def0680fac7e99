"""Keeps the process alive that draws what the robot's eyes see, and hands it the robot's posture.

All of it happens in a thread that sleeps while that process lives. Neither the time nor the end of it touches the
control ticks, which write a posture to shared memory and nothing else.

The process tries one OpenGL backend, and is the trial at the same time: if it ends before it is ready, or says that it
cannot render, the next backend is tried. If it ends later it is started again, after pauses that grow to
`LONGEST_PAUSE` while it keeps ending.
"""

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable

from ik_client.eyes.block_file import sweep
from ik_proto import Array
from sim_client.gl import NoRendering, backends, none_works
from sim_client.posture_memory import Posture, PostureMemory

FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
"""Between the end of the process and its new start [s]."""

NICENESS = 10
"""Priority of the process: the lower, the higher this number."""

_LONG_LIFE = 10.0
_STOP_LIMIT = 3.0


class EyeSupervisor:
    """The eyes of a robot that runs.

    Attributes:
        process_id: Of the process that draws; None while there is none.
        starts: How often it was started.
    """

    def __init__(self, url: str, robot: str, nq: int, say: Callable[[str], None], gone: Callable[[], None]) -> None:
        """Start the process, without waiting for it.

        Args:
            url: Where pictures go: see `ik_client.eyes`.
            robot: Name or path of the robot's description.
            nq: Number of joint positions of its model.
            say: Told in a line what goes wrong; called in another thread.
            gone: Called in another thread when there will be no pictures, because this machine cannot render.
        """
        self.process_id: int | None = None
        self.starts = 0
        self._url = url
        self._robot = robot
        self._say = say
        self._gone = gone
        self._said = ""
        self._memory = PostureMemory(nq)
        self._process: subprocess.Popen[bytes] | None = None
        self._closing = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="eyes", daemon=True)
        self._thread.start()

    def show(self, now: float, qpos: Array) -> None:
        """Hand over the posture of a control tick; takes microseconds.

        Args:
            now: Monotonic time [s].
            qpos: Positions of all joints, shape (nq,) [rad].
        """
        self._memory.write(Posture(now, qpos))

    def close(self) -> None:
        """End the process."""
        self._closing.set()
        with self._lock:
            process = self._process
        if process is not None and process.stdin is not None:
            process.stdin.close()  # which is what it waits for
            process.terminate()  # in case it does not wait yet
            try:
                process.wait(_STOP_LIMIT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                sweep()
        self._thread.join(_STOP_LIMIT)
        self._memory.close()

    def _run(self) -> None:
        try:
            candidates = tried = backends()
            pause, was_ready = FIRST_PAUSE, False
            while not self._closing.is_set():
                begin = time.monotonic()
                ready, fault = self._live(candidates[0])
                if self._closing.is_set():
                    return
                was_ready |= ready
                if not was_ready and (fault is None or fault["rendering"]):
                    candidates = candidates[1:]
                    if not candidates:
                        raise none_works(tried)
                    continue
                pause = FIRST_PAUSE if time.monotonic() - begin > _LONG_LIFE else pause
                self._said = "" if ready else self._said
                self._tell(
                    f"no pictures: {fault['fault']}" if fault else "the eyes' process has ended; it starts again"
                )
                self._closing.wait(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE)
        except NoRendering as fault:
            self._say(str(fault))
            self._gone()

    def _tell(self, line: str) -> None:
        """Say something once, until there is something else to say."""
        if line != self._said:
            self._said = line
            self._say(line)

    def _live(self, backend: str) -> tuple[bool, dict | None]:
        """Start the process and wait for its end.

        Args:
            backend: What it is to render with.

        Returns:
            Whether it was ready once, and the fault that it spoke of.
        """
        command = [sys.executable, "-P", "-m", "sim_client.eye_process", backend, self._url, self._robot]
        with self._lock:
            if self._closing.is_set():
                return False, None
            self._process = process = subprocess.Popen(
                [*command, str(self._memory.descriptor)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                pass_fds=(self._memory.descriptor,),
                start_new_session=True,  # Ctrl-C is for this process, which then ends the child.
            )
        # As polite as a process can be, from its first moment: what the robot needs comes first.
        with contextlib.suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, process.pid, NICENESS)
        self.starts += 1
        self.process_id = process.pid
        assert process.stdin is not None
        assert process.stdout is not None
        ready, fault = False, None
        with process.stdin, process.stdout:
            for line in process.stdout:
                words = _words(line)
                ready |= "ready" in words
                fault = words if "fault" in words else fault
        process.wait()
        self.process_id = None
        return ready, fault


def _words(line: bytes) -> dict:
    """What the process says; nothing where a line was cut off by its end, or is a library's own."""
    try:
        words = json.loads(line)
    except ValueError:
        return {}
    return words if isinstance(words, dict) else {}
