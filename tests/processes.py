"""Real processes of the system, as the tests of clients start them."""

import json
import os
import select
import subprocess
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

LIMIT = 60.0


@contextmanager
def running(
    *command: Any, log: Path, env: Mapping[str, str] | None = None
) -> Generator[tuple[subprocess.Popen[str], dict[str, Any]]]:
    """A process of a package's command, and the line of JSON with which it says that it is ready; killed at the end."""
    with (
        log.open("w") as errors,
        subprocess.Popen(
            [sys.executable, "-m", *map(str, command)],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env={**os.environ, **(env or {})},
        ) as process,
    ):
        assert process.stdout is not None
        try:
            assert select.select([process.stdout], [], [], LIMIT)[0], log.read_text()
            line = process.stdout.readline()
            assert line, log.read_text()
            yield process, json.loads(line)
        finally:
            process.kill()
