"""Which tests run a line: what coverage recorded with the test that was running as its context."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from pathlib import Path

from coverage import CoverageData


class Covering:
    """Tests by the lines they run, as ``pytest --cov --cov-context=test`` stored them for the same tree.

    :raises ValueError: if the file names no test.
    """

    def __init__(self, root: Path, file: Path) -> None:
        self._root = root
        self._data = CoverageData(str(file))
        self._data.read()
        if not any(self._data.measured_contexts()):
            raise ValueError(f"{file} does not say which test ran which line: make it with --cov-context=test")
        self._lines: dict[str, dict[int, list[str]]] = {}

    def tests(self, path: str, line: int, files: list[str]) -> list[str]:
        """Tests that run a line, in the order in which their files are given; files that are not given come last.

        None are known of lines that run while a module is imported, or in another process.
        """
        return _in_order(self._contexts(path).get(line, []), files)

    def users(self, path: str, files: list[str]) -> list[str]:
        """Tests that run any line of a file, in the same order: those that see what it defines at its import."""
        return _in_order(chain.from_iterable(self._contexts(path).values()), files)

    def _contexts(self, path: str) -> dict[int, list[str]]:
        if path not in self._lines:
            self._lines[path] = self._data.contexts_by_lineno(str(self._root / path))
        return self._lines[path]


def _in_order(contexts: Iterable[str], files: list[str]) -> list[str]:
    """Tests by their files, then whole files in which a fixture ran: tests that share it are not told of."""
    order = {file: number for number, file in enumerate(files)}
    parts = [context.rpartition("|") for context in contexts if "|" in context]
    shared = {test.partition("::")[0] for test, _, phase in parts if phase == "setup"}
    return sorted(
        {test for test, _, _ in parts} | shared,
        key=lambda test: ("::" not in test, order.get(test.partition("::")[0], len(order)), test),
    )
