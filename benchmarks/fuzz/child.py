"""One atheris run in a process of its own: atheris instruments the modules it imports, and ends the process itself.

    python -m benchmarks.fuzz.child --target NAME --frames N --seed N --folder FOLDER [--kernel auto|vm]

Says how far it is, a JSON document a line, on standard output; libFuzzer's own log goes to standard error. Exit code 0
after so many frames. Otherwise a frame broke the contract: the traceback is on standard error and the input in FOLDER,
as `crash-...`, or `timeout-...` where it took too long.
"""

import argparse
import json
import os
import random
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["ik_proto", "ik_service.service", "ik_service.dispatcher"]):
    from benchmarks.fuzz.targets import Target
    from benchmarks.fuzz.workbench import TARGETS, build

from benchmarks.fuzz.examples import replies, requests
from benchmarks.fuzz.mutator import Mutator
from ik_proto import encode_frame

REPORT_S = 0.5
HANG_S = 10
MAX_LEN = 16 * 1024
BYTES_SHARE = 0.25
"""Share of the mutations that are libFuzzer's own, which know bytes and nothing else."""


class Watched:
    """A target whose frames and times are reported, and that ends the process after enough of them."""

    def __init__(self, target: Target, frames: int, slowest: Path) -> None:
        """Begin.

        Args:
            target: What takes the inputs.
            frames: After how many the process ends.
            slowest: Where the slowest input is kept.
        """
        self._target = target
        self._frames = frames
        self._file = slowest
        self._inputs = 0
        self._slowest_s = 0.0
        self._reported = self._started = time.monotonic()

    def __call__(self, data: bytes) -> None:
        """Pass an input on."""
        before = time.thread_time()
        self._target(data)
        took = time.thread_time() - before
        self._inputs += 1
        if took > self._slowest_s:
            self._slowest_s = took
            self._file.write_bytes(data)
        if self._target.frames >= self._frames:
            self._report()
            os._exit(0)  # what atheris does too: libFuzzer has no way back
        if time.monotonic() - self._reported > REPORT_S:
            self._report()

    def _report(self) -> None:
        self._reported = time.monotonic()
        report = {
            "frames": self._target.frames,
            "inputs": self._inputs,
            "seconds": self._reported - self._started,
            "slowest_ms": self._slowest_s * 1e3,
            "counts": dict(self._target.counts),
        }
        print(json.dumps(report), flush=True)


def spoiler(mutator: Mutator, framed: bool) -> Callable[[bytes, int, int], bytes]:
    """Mutate mostly by structure, and sometimes as libFuzzer does."""
    spoil = mutator.stream if framed else mutator.body

    def mutate(data: bytes, max_size: int, seed: int) -> bytes:
        mutator.rng.seed(seed)
        if mutator.rng.random() < BYTES_SHARE:
            return atheris.Mutate(data, max_size)
        return spoil(data)[:max_size]

    return mutate


def main() -> None:
    """Fuzz until enough frames were seen."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--target", choices=TARGETS, required=True)
    parser.add_argument("--frames", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--kernel", default="auto")
    options = parser.parse_args()

    codec, side, framed = TARGETS[options.target]
    target = build(options.target, options.kernel)
    examples = (requests if side == "requests" else replies)(codec)
    corpus = options.folder / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for index, body in enumerate(examples):
        (corpus / f"example-{index}").write_bytes(encode_frame(body) if framed else body)

    arguments = [sys.argv[0], f"-seed={options.seed}", f"-timeout={HANG_S}", f"-max_len={MAX_LEN}", "-len_control=0"]
    # -reload: what other processes leave in the corpus is looked for by the clock, and the same seed would differ.
    arguments += ["-reload=0", "-rss_limit_mb=2048", f"-artifact_prefix={options.folder}/", str(corpus)]
    mutator = Mutator(codec, examples, random.Random(options.seed))
    warnings.simplefilter("error")  # what would be a warning in the service's log is a fault here
    watched = Watched(target, options.frames, options.folder / "slowest")
    atheris.Setup(arguments, watched, custom_mutator=spoiler(mutator, framed))
    atheris.Fuzz()


if __name__ == "__main__":
    main()
