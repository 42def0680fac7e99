"""How long the stages of a client's way take, told live and at the end: one `Latency` for each of them."""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from ik_client.latency import Latency


class StageLatencies:
    """The latencies of a run.

    Attributes:
        words: What each stage is from and to, by its name.
    """

    def __init__(self, words: Mapping[str, str], clock: Callable[[], float] = time.monotonic) -> None:
        """Start without a sample.

        Args:
            words: Names of the stages in their order, and what each is from and to.
            clock: Monotonic time, the teleop loop's own [s].
        """
        self.words = words
        self._clock = clock
        self._stages = {name: Latency(clock) for name in words}
        self._used: object | None = None

    def __getitem__(self, name: str) -> Latency:
        """The stage of a name."""
        return self._stages[name]

    def first_use(self, used: object | None) -> bool:
        """Whether a tick is the first to use something; what an earlier tick has used gives no sample.

        Args:
            used: What it used; None for nothing.
        """
        if used is None or used is self._used:
            return False
        self._used = used
        return True

    def recent(self) -> dict[str, float | None]:
        """Stages by name and what they took of late [ms]; None where there were no samples."""
        return {name: stage.recent_ms for name, stage in self._stages.items()}

    def document(self) -> dict[str, dict[str, Any]]:
        """All samples, JSON-ready: percentiles [ms] and their number, by stage; stages without samples left out."""
        summaries = {name: stage.summary() for name, stage in self._stages.items()}
        return {name: asdict(summary) for name, summary in summaries.items() if summary}

    def table(self) -> list[str]:
        """The same for a person, a line each; empty without samples."""
        rows = self.document()
        if not rows:
            return []
        columns = ("p50", "p95", "p99", "max")
        names, words = (2 + max(map(len, texts)) for texts in (self.words, self.words.values()))
        head = f"{'latency [ms]':<{names + words}}" + "".join(f"{name:>9}" for name in columns)
        lines = [
            f"{name:<{names}}{self.words[name]:<{words}}"
            + "".join(f"{row[column]:9.2f}" for column in columns)
            + f"{row['n']:10d}"
            for name, row in rows.items()
        ]
        return [f"{head}{'samples':>10}", *lines]
