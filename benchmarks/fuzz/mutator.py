"""Turns messages into worse ones: by their structure, so that most still decode and get far into the readers.

Everything is drawn from one seeded generator: the same seed makes the same bytes.
"""

import copy
import random
import struct
from collections.abc import Sequence
from typing import Any

from benchmarks.fuzz.hostile import Pairs, Write, write_json, write_msgpack
from benchmarks.fuzz.wild import JSON_VALUES, MSGPACK_VALUES, NUMBERS, WORDS
from ik_proto import JSON, Codec

_CONTAINERS = (dict, list)
_MOST_FRAMES = 3
_Place = tuple[Any, Any]


class Mutator:
    """Makes bodies, and streams of them, from examples."""

    def __init__(self, codec: Codec, examples: Sequence[bytes], rng: random.Random) -> None:
        """Take what to start from.

        Args:
            codec: What bodies are encoded with.
            examples: Sound bodies.
            rng: Where every choice comes from.
        """
        self._codec = codec
        self._documents = [codec.decode(example) for example in examples]
        self._write: Write = write_json if codec is JSON else write_msgpack
        self._values = JSON_VALUES if codec is JSON else MSGPACK_VALUES
        self.rng = rng

    def body(self, body: bytes = b"") -> bytes:
        """Spoil a body; one that does not decode is replaced by an example first."""
        rng = self.rng
        try:
            document = self._codec.decode(body)
        except Exception:  # the decoder is what is under test: its faults are for the target to find
            document = copy.deepcopy(rng.choice(self._documents))
        try:
            written = self._write(self._spoiled(document))
        except RecursionError:  # nested too deep to be taken apart: its bytes will do
            return self._damaged(body)
        return self._damaged(written) if rng.random() < 0.05 else written

    def stream(self, stream: bytes = b"") -> bytes:
        """Spoil a stream of frames: a body, or the framing."""
        rng = self.rng
        bodies = _bodies(stream)
        if bodies and rng.random() < 0.8:
            index = rng.randrange(len(bodies))
            bodies[index] = self.body(bodies[index])
        else:
            bodies.insert(rng.randint(0, len(bodies)), self.body())
        made = b"".join(struct.pack(">I", len(body)) + body for body in bodies[-_MOST_FRAMES:])
        if rng.random() < 0.1:
            last = bodies[-1]
            length = max(0, rng.choice((len(last) - 1, len(last) + 1, 0, 1, 2**21, 2**21 + 1, 2**31, 2**32 - 1)))
            made += struct.pack(">I", length) + last
        return self._damaged(made) if rng.random() < 0.05 else made

    def _spoiled(self, document: dict[Any, Any]) -> Any:
        """Change a few places, or repeat a key, or say something else altogether."""
        rng = self.rng
        for _ in range(rng.choice((1, 1, 1, 2, 2, 4))):
            self._spoil(document)
        if rng.random() < 0.04:
            return Pairs([*document.items(), (rng.choice(list(document) or [""]), self._value())])
        return self._value() if rng.random() < 0.02 else document

    def _spoil(self, document: dict[Any, Any]) -> None:
        """Change one place."""
        rng = self.rng
        places = list(_places(document))
        if not places:
            document[rng.choice(WORDS)] = self._value()
            return
        # Nine places of ten are numbers deep inside arrays: as often, take one of the message's own fields.
        holder, key = rng.choice(places) if rng.random() < 0.5 else (document, rng.choice(list(document)))
        value = holder[key]
        match rng.randrange(9):
            case 0 | 1:
                holder[key] = self._value()
            case 2:
                holder[key] = rng.choice(NUMBERS)
            case 3:
                del holder[key]
            case 4:
                document[rng.choice(WORDS)] = copy.deepcopy(value)
            case 5:
                other = rng.choice(self._documents)
                document.update(copy.deepcopy(dict(rng.sample(sorted(other.items()), rng.randint(1, len(other))))))
            case 6:
                holder[key] = self._rearranged(value)
            case 7:
                holder[key] = self._scaled(value)
            case 8 if isinstance(holder, list):
                holder[key:key] = [copy.deepcopy(value)] * rng.choice((1, 2, 1100 if rng.random() < 0.02 else 3))
            case _:
                holder[key] = rng.choice(WORDS)

    def _value(self) -> Any:
        rng = self.rng
        return copy.deepcopy(rng.choice(rng.choice((self._values, NUMBERS, WORDS))))

    def _rearranged(self, value: Any) -> Any:
        """The same numbers in another shape."""
        match self.rng.randrange(5):
            case 0 if isinstance(value, list) and value and all(isinstance(row, list) for row in value):
                return [list(column) for column in zip(*value, strict=False)]
            case 1 if isinstance(value, list):
                return [entry for row in value for entry in (row if isinstance(row, list) else [row])]
            case 2 if isinstance(value, bytes | list):
                return value[: self.rng.randint(0, len(value))]
            case 3 if isinstance(value, bytes) and len(value) % 8 == 0:
                return list(struct.unpack(f"<{len(value) // 8}d", value))
            case _:
                return [value]

    def _scaled(self, value: Any) -> Any:
        """Numbers times a factor: a reflection, a unit mistake, or just beside what is tolerated."""
        factor = self.rng.choice((-1.0, 0.0, 1.0 + 1e-9, 1.0002, 1.001, 2.0, 57.29577951308232, 1000.0, 1e75, 1e160))
        return _times(value, factor)

    def _damaged(self, data: bytes) -> bytes:
        """A few bytes changed, dropped or doubled."""
        rng, damaged = self.rng, bytearray(data)
        for _ in range(rng.randint(1, 4)):
            if not damaged:
                break
            at = rng.randrange(len(damaged))
            match rng.randrange(4):
                case 0:
                    damaged[at] = rng.randrange(256)
                case 1:
                    damaged[at] ^= 1 << rng.randrange(8)
                case 2:
                    del damaged[at : at + rng.choice((1, 4, len(damaged)))]
                case _:
                    damaged[at:at] = damaged[at : at + rng.choice((1, 4, 64))]
        return bytes(damaged)


def _places(value: Any) -> list[_Place]:
    """Every container and key below a value."""
    places: list[_Place] = []
    waiting = [value]
    while waiting and len(places) < 1000:
        holder = waiting.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        places += [(holder, key) for key in keys]
        waiting += [holder[key] for key in keys if type(holder[key]) in _CONTAINERS]
    return places


def _times(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_times(entry, factor) for entry in value]
    if isinstance(value, bytes) and len(value) % 8 == 0:
        return b"".join(struct.pack("<d", number * factor) for (number,) in struct.iter_unpack("<d", value))
    if isinstance(value, float):
        return value * factor
    return value


def _bodies(stream: bytes) -> list[bytes]:
    """The frames that a stream begins with, and what is left as a last one."""
    bodies, at = [], 0
    while len(stream) - at >= 4 and len(bodies) < _MOST_FRAMES:
        (length,) = struct.unpack_from(">I", stream, at)
        bodies.append(stream[at + 4 : at + 4 + length])
        at += 4 + length
    return bodies
