"""`ik-gamepad` with a pad that is not there, moved by lines on standard input.

    axis left_stick_x 0.5
    button south 1
    unplug | plug | rest
    key space 1 | focus 0          of the keyboard, in a window that nobody sees

Run as `python pad_process.py [--events FILE] OPTIONS OF IK-GAMEPAD`. Each line is carried out at once, in a thread of
its own, as a hand would; the file tells when, by the monotonic clock that all processes of a machine share.
"""

import json
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import gamepad_client.session as session
from gamepad_client.cli import main
from ik_client.devices import Devices


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


if __name__ == "__main__":
    words = sys.argv[1:]
    if words[:1] == ["--events"]:
        HandledDevices.events = Path(words[1])
        words = words[2:]
    session.Devices = HandledDevices  # ty: ignore[invalid-assignment]
    sys.exit(main(words))
