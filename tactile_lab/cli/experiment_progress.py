"""How far an experiment is: a bar on a terminal, now and then a line elsewhere; failed runs always get a line."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from tactile_lab.cli.console import people, say
from tactile_lab.experiments.cells import Row

_LINES = 20
"""Where there is no terminal, progress is told so many times."""


class ExperimentProgress:
    """Told about finished runs, tells people."""

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
        """A run has ended."""
        self._bar.update(self._task, completed=done)
        if row.problem:
            say(f"{row.cell.words()}: {row.problem}", "yellow")
        if not people.is_terminal and (done == total or done % max(1, total // _LINES) == 0):
            say(f"{self._name}: {done} of {total} runs")
