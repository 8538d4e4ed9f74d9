"""Progress of an experiment: a bar on a terminal, occasional lines elsewhere; a failed run always gets a line."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from tactile_lab.cli.console import people, say
from tactile_lab.experiments.cells import Row

_LINES = 20
"""Number of progress lines if there is no terminal."""


class ExperimentProgress:
    """Shows finished runs to people."""

    def __init__(self, name: str, total: int) -> None:
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
        self._bar = Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=people, transient=True)
        self._name, self._total = name, total
        self._task = self._bar.add_task(name, total=total)

    def __enter__(self) -> Self:
        if people.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def on_finished(self, row: Row, done: int, total: int) -> None:
        """A run has finished."""
        self._bar.update(self._task, completed=done)
        if row.problem:
            say(f"{row.cell.words()}: {row.problem}", "yellow")
        if not people.is_terminal and (done == total or done % max(1, total // _LINES) == 0):
            say(f"{self._name}: {done} of {total} runs")
