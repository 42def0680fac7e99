"""`ik-gamepad` with a pad that is not there, moved by lines on standard input.

    axis left_stick_x 0.5
    button south 1
    unplug | plug | rest
    key space 1 | focus 0          of the keyboard, in a window that nobody sees

Run as `python pad_process.py [--events FILE] [--commands FILE.npy] OPTIONS OF IK-GAMEPAD`. Each line is carried out at
once, in a thread of its own, as a hand would; the events tell when, by the monotonic clock that all processes of a
machine share. The commands are those that left for the robot, a row each: when, what was asked of the left wrist [m/s],
and the joints.
"""

import argparse
import json
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import gamepad_client.listing as listing
import gamepad_client.session as session
from gamepad_client.cli import main
from ik_client import Command
from ik_client.devices import Devices
from ik_client.robot_end import RobotLink


class HandledDevices(Devices):
    """Devices in somebody's hands."""

    events: Path | None = None

    def __init__(self, *arguments, **options) -> None:
        super().__init__(*arguments, **options)
        from virtual_pad import VirtualPad

        self._virtual = VirtualPad()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in sys.stdin:
            word, *rest = line.split()
            now = time.monotonic()
            self._do(word, rest)
            if self.events is not None:
                with self.events.open("a") as file:
                    file.write(json.dumps([now, line.strip()]) + "\n")

    def _do(self, word: str, rest: list[str]) -> None:
        pygame = self._pygame
        match word:
            case "axis":
                self._virtual.axis(rest[0], float(rest[1]))
            case "button":
                self._virtual.button(rest[0], rest[1] == "1")
            case "key":
                kind = pygame.KEYDOWN if rest[-1] == "1" else pygame.KEYUP
                pygame.event.post(pygame.event.Event(kind, key=pygame.key.key_code(" ".join(rest[:-1]))))
            case "focus":
                kind = pygame.WINDOWFOCUSGAINED if rest[0] == "1" else pygame.WINDOWFOCUSLOST
                pygame.event.post(pygame.event.Event(kind))
            case "unplug" | "plug" | "rest":
                getattr(self._virtual, word)()


class HeardLink(RobotLink):
    """A link that keeps what is sent."""

    rows: list[np.ndarray]

    def send(self, command: Command) -> None:
        asked = np.zeros(3) if command.motion is None else command.motion.twists[0, :3]
        super().send(command)
        self.rows.append(np.concatenate([[time.monotonic()], asked, command.q]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for flag in ("--events", "--commands"):
        parser.add_argument(flag, type=Path)
    files, words = parser.parse_known_args()
    HandledDevices.events, HeardLink.rows = files.events, []
    session.Devices, session.RobotLink = HandledDevices, HeardLink  # ty: ignore[invalid-assignment]
    listing.Devices = HandledDevices  # ty: ignore[invalid-assignment]
    code = main(words)
    if files.commands is not None:
        np.save(files.commands, np.array(HeardLink.rows))
    sys.exit(code)
