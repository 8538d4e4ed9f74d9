"""Groups of runs of the same setting, and the columns of their tables.

A run without a figure (for example because it gave no shape) counts as infinitely wrong; otherwise a method would
improve by failing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from tactile_lab.evaluation.spread import Spread
from tactile_lab.experiments.cells import Row, Setting, Value

REFERENCE_METHOD = "known-pose"
LEFT_OUT, NOTHING = "without", "nothing"
"""The setting that names what a run leaves out, and its value for the reference runs of paired differences."""

Kind: TypeAlias = Literal[
    "spread",
    "mean",
    "estimate",
    "median",
    "pooled",
    "rms",
    "within",
    "percent",
    "sum",
    "correlation",
    "paired",
    "shares",
]


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes:
        title: heading, with the unit.
        key: name of the figure in a row.
        digits: number of decimals.
        kind: "spread" gives median / p90 / maximum, "median" the median, "mean" the mean, "pooled" median / p95 of all
            numbers in the lists of all runs, "rms" their root mean square, "within" how many of them are at most 1, 2
            and 3, in per cent, "percent" the mean of shares or flags, "sum" the total, "estimate" the
            mean with its standard error, "correlation" Pearson's of all pairs in the lists of all runs, "paired" the
            mean difference to the same runs with nothing left out, with its bootstrap 95 % interval, "shares" the mean
            of each share in the lists of all runs.
        versus: the reference method, whose median is used for the ratio to add.
        most: larger values are clipped to this in differences, so that one hopeless run does not hide all others.
    """

    title: str
    key: str
    digits: int = 1
    kind: Kind = "spread"
    versus: bool = False
    most: float = math.inf


@dataclass(frozen=True)
class Group:
    """All runs of one setting.

    Attributes:
        setting: what they have in common.
        rows: the runs.
    """

    setting: Setting
    rows: tuple[Row, ...]

    def __getitem__(self, name: str) -> Value:
        """A value of the setting. Raises KeyError."""
        return dict(self.setting)[name]

    @property
    def failures(self) -> list[tuple[int, str]]:
        """Seed and reason of each failed run."""
        return [(row.cell.seed, row.failure) for row in self.rows if row.failure]

    @property
    def failed_share(self) -> float:
        """Share of failed runs."""
        return len(self.failures) / len(self.rows)

    def values(self, key: str) -> list[float]:
        """One number per run; infinite if it has none."""
        found = [(row.figures or {}).get(key) for row in self.rows]
        return [math.inf if value is None else float(value) for value in found]

    def spread(self, key: str) -> Spread:
        """The spread over all runs."""
        return Spread.of(self.values(key))

    def pairs(self, key: str) -> list[list[float]]:
        """The pairs of numbers in all lists of that name."""
        return [pair for row in self.rows for pair in (row.figures or {}).get(key, [])]

    def pool(self, key: str) -> list[float]:
        """The numbers in all lists of that name."""
        return [value for row in self.rows for value in (row.figures or {}).get(key, [])]


def group_runs(rows: Sequence[Row], *, over: Sequence[str] = ()) -> list[Group]:
    """Group runs of equal settings, in order of appearance; seeds and the settings named in ``over`` are ignored."""
    groups: dict[Setting, list[Row]] = {}
    for row in rows:
        setting = tuple(pair for pair in row.cell.setting if pair[0] not in over)
        groups.setdefault(setting, []).append(row)
    return [Group(setting, tuple(members)) for setting, members in groups.items()]


def varying_settings(groups: Sequence[Group]) -> list[str]:
    """Names of the settings that differ between groups; of all settings if there is only one group."""
    names = [name for name, _ in groups[0].setting]
    return [name for name in names if len({group[name] for group in groups}) > 1] or names
