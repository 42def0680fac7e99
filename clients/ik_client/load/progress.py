"""A progress bar on a terminal, silence anywhere else."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn


class ProgressBar:
    """One bar per stage of a run."""

    def __init__(self, console: Console) -> None:
        """Prepare the bars.

        Args:
            console: Where they go; shown only where it is a terminal.
        """
        self._bars = Progress(
            TextColumn("{task.description:<18}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} % {task.fields[note]}"),
            console=console,
            disable=not console.is_terminal,
            refresh_per_second=4,  # drawing competes with the clients for this process
        )
        self._task: TaskID | None = None

    def stage(self, name: str, total: float) -> None:
        """Begin a stage of so many steps or seconds."""
        self._task = self._bars.add_task(name, total=total, note="")

    def advance(self, done: float, note: str = "") -> None:
        """So much of the stage is done."""
        if self._task is not None:
            self._bars.update(self._task, completed=done, note=note)

    def __enter__(self) -> Self:
        """Show the bars."""
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave them as they are."""
        self._bars.stop()
