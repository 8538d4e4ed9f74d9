"""One experiment: the varied settings, the work of one run, and the presentation of the outcome.

Reported seeds are 1000 to 1029; seeds for development are 0 to 99. Nothing is ever tuned on the reported seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from drivers.core.errors import ConfigurationError
from tactile_lab.experiments.cells import Cell, Row, Setting, Work, planned_cells
from tactile_lab.experiments.groups import Column
from tactile_lab.experiments.plot_data import Plot

REPORTED_SEEDS = tuple(range(1000, 1030))

PlotOf: TypeAlias = Callable[[Sequence[Row]], Plot]


@dataclass(frozen=True)
class Experiment:
    """One experiment.

    Attributes:
        name: its name on the command line.
        sentence: what it shows.
        settings: the varied settings; takes the requested number of grasps.
        work: runs one cell.
        columns: the figures in the tables.
        plot: makes the plot from all rows.
        pooled: settings over which a second table takes all runs together.
        kind: returns the kind of a run, for another table that combines all runs of a kind.
        grasps: number of grasps of a run; None if it has none.
        left_out: says what cannot be run on this machine, and why; "" if nothing.
    """

    name: str
    sentence: str
    settings: Callable[[int], list[Setting]]
    work: Work
    columns: tuple[Column, ...]
    plot: PlotOf
    pooled: tuple[str, ...] = ()
    kind: Callable[[Cell], str] | None = None
    grasps: int | None = None
    left_out: Callable[[], str] = str

    def cells(
        self,
        seeds: Sequence[int] = REPORTED_SEEDS,
        only: Mapping[str, Sequence[str]] | None = None,
        grasps: int | None = None,
    ) -> list[Cell]:
        """All runs.

        Args:
            seeds: of every setting.
            only: limits some of the settings to these values, given as texts.
            grasps: number of grasps instead of the experiment's own.

        Raises:
            ConfigurationError: there is no such setting, or nothing is left.
        """
        settings = self.settings(grasps or self.grasps or 0)
        for name, values in (only or {}).items():
            settings = _limit(settings, name, values)
        return planned_cells(settings, seeds)


def _limit(settings: list[Setting], name: str, values: Sequence[str]) -> list[Setting]:
    if not any(name in dict(setting) for setting in settings):
        hint = f"Settings to restrict: {', '.join(dict(settings[0]))}"
        raise ConfigurationError(f"{name!r} is not a varied setting", where="--only", hint=hint)
    known = list(dict.fromkeys(str(dict(setting)[name]) for setting in settings))
    if unknown := [value for value in values if value not in known]:
        raise ConfigurationError(f"no {name} {', '.join(map(repr, unknown))}", where="--only", hint=_choice(known))
    return [setting for setting in settings if str(dict(setting)[name]) in values]


def _choice(values: Sequence[str]) -> str:
    """What can be chosen, separated as the option separates it."""
    if any("," in value for value in values):
        return f"Choose from {'; '.join(values)}. They contain commas: separate or end them by ;"
    return f"Choose from {', '.join(values)}"
