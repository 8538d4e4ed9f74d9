"""One run of an experiment and its outcome, as plain data that can be stored in a file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

from drivers.core.errors import TactileLabError
from tactile_lab.evaluation.registration import FAILURE_LIMIT_MM

Value: TypeAlias = str | int | float
Setting: TypeAlias = tuple[tuple[str, Value], ...]


FOLLOWED = ("ok", "complete", "partial", "ambiguous")
"""Status of a run whose object could be followed, or that did what it should ("ok")."""


@dataclass(frozen=True)
class Cell:
    """One run.

    Attributes:
        setting: names and values of the varied settings, in the order of the table's columns.
        seed: of the data and of the method.
    """

    setting: Setting
    seed: int

    def __getitem__(self, name: str) -> Any:
        """A value of the setting. Raises KeyError."""
        return dict(self.setting)[name]

    @property
    def key(self) -> str:
        """The run's identity in a file of results."""
        return json.dumps([self.setting, self.seed])

    def words(self) -> str:
        """The run in one line of text, for people."""
        return ", ".join([*(str(value) for _, value in self.setting), f"seed {self.seed}"])


@dataclass(frozen=True)
class Row:
    """The outcome of one run.

    Attributes:
        cell: the run.
        figures: numbers by name, and some texts and lists; None if the run ended in an error.
        problem: the message of that error, "" otherwise.
    """

    cell: Cell
    figures: Mapping[str, Any] | None
    problem: str = ""

    @property
    def failure(self) -> str:
        """Why the run counts as failed, or ""."""
        if self.figures is None:
            return self.problem
        if (status := self.figures.get("status", "ok")) not in FOLLOWED:
            return status if status.startswith("object ") else f"object {status}"
        registration = self.figures.get("registration_mm")
        if registration is not None and registration > FAILURE_LIMIT_MM:
            return f"registration above {FAILURE_LIMIT_MM:g} mm"
        return "no shape" if self.figures.get("hausdorff_mm", 0.0) is None else ""

    def as_json(self) -> dict[str, Any]:
        """As plain data; the inverse is :meth:`from_json`."""
        return {
            "setting": dict(self.cell.setting),
            "seed": self.cell.seed,
            "figures": self.figures,
            "problem": self.problem,
        }

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> Row:
        """Raises KeyError or TypeError for what :meth:`as_json` did not write."""
        cell = Cell(tuple(dict(found["setting"]).items()), int(found["seed"]))
        return cls(cell, found["figures"], str(found["problem"]))


Work: TypeAlias = Callable[[Cell], Mapping[str, Any]]
"""Runs a cell and returns its figures; a function at module level, so that other processes can import it."""

Execute: TypeAlias = Callable[[Sequence[Cell], Work], Iterator[Row]]
"""Makes runs, somewhere, and yields their rows as they are finished."""


def execute(cell: Cell, work: Work) -> Row:
    """Run one cell; any error becomes the result of this run, and the others continue. So does a figure that no file of
    results can hold, as infinity.
    """
    try:
        figures = work(cell)
        json.dumps(figures, allow_nan=False)
        return Row(cell, figures)
    except TactileLabError as error:
        return Row(cell, None, str(error))
    except Exception as error:  # a defect appears in the table as a failed run with its name
        return Row(cell, None, f"{type(error).__name__}: {error}")


def grid(**values: Sequence[Value]) -> list[Setting]:
    """Every combination of the values, the last one fastest."""
    return [tuple(zip(values, combination, strict=True)) for combination in product(*values.values())]


def planned_cells(settings: Sequence[Setting], seeds: Sequence[int]) -> list[Cell]:
    """Every setting with every seed, seed by seed, so that an interrupted experiment has runs of every setting."""
    return [Cell(setting, seed) for seed in seeds for setting in settings]
