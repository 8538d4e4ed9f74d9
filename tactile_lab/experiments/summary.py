"""Groups of runs: spreads over seeds and shapes, failures with their reasons, and tables.

A run without a figure (for example because it gave no shape) counts as infinitely wrong; otherwise a method would
improve by failing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from tactile_lab.evaluation.spread import Interval, Spread, number, quantile
from tactile_lab.experiments.cells import Row, Setting, Value

REFERENCE_METHOD = "known-pose"
LEFT_OUT, NOTHING = "without", "nothing"
"""The setting that names what a run leaves out, and its value for the reference runs of paired differences."""

UNKNOWN = "–"
LEAST_PAIRS, _DRAWS = 20, 2000
"""Smallest number of pairs for the interval of a ratio, and the number of bootstrap samples."""

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


def table(
    groups: Sequence[Group], columns: Sequence[Column], units: Mapping[str, str], names: Sequence[str] | None = None
) -> list[list[str]]:
    """Header and body of the table as texts.

    Args:
        groups: one per row of the table.
        columns: figures to show.
        units: units of settings, by their names.
        names: settings to show; None for those that differ.
    """
    names = varying_settings(groups) if names is None else names
    head = [f"{name}, {units[name]}" if name in units else name for name in names]
    head += ["runs", *(title for column in columns for title in _titles(column)), "failed", "why"]
    body = []
    for group in groups:
        cells = [text for column in columns for text in _texts(group, column, _reference(group, groups), groups)]
        failed = f"{len(group.failures)} ({100 * group.failed_share:.0f} %)" if group.failures else "0"
        body.append([*(str(group[name]) for name in names), str(len(group.rows)), *cells, failed, reasons(group)])
    return [head, *body]


def short_table(groups: Sequence[Group], columns: Sequence[Column]) -> list[list[str]]:
    """Header and body of a table that fits a terminal: settings that differ, the first two figures, and failures."""
    names, shown = varying_settings(groups), columns[:2]
    body = [[str(group[name]) for name in names] for group in groups]
    for line, group in zip(body, groups, strict=True):
        line += [text for column in shown for text in _texts(group, column, _reference(group, groups), groups)]
        line.append(f"{len(group.failures)} of {len(group.rows)}")
    return [[*names, *(title for column in shown for title in _titles(column)), "failed"], *body]


def reasons(group: Group) -> str:
    """Why runs failed, the most frequent reason first, and with which seeds."""
    seeds: dict[str, list[int]] = {}
    for seed, reason in group.failures:
        seeds.setdefault(reason, []).append(seed)
    ordered = sorted(seeds.items(), key=lambda item: -len(item[1]))
    return "; ".join(f"{reason}: {len(found)} ({_shorten(sorted(set(found)))})" for reason, found in ordered)


def _shorten(seeds: list[int], most: int = 3) -> str:
    shown = ", ".join(map(str, seeds[:most]))
    return shown if len(seeds) <= most else f"{shown} and {len(seeds) - most} more"


def _titles(column: Column) -> list[str]:
    return [column.title, f"× {REFERENCE_METHOD}"] if column.versus else [column.title]


def _texts(group: Group, column: Column, reference: Group | None, groups: Sequence[Group] = ()) -> list[str]:
    if column.kind == "paired":
        found = paired(group, column, groups)
        return [UNKNOWN if found is None else found.text(column.digits)]
    text = _SHOWN[column.kind](group, column)
    if not column.versus:
        return [text]
    base = math.inf if reference is None else reference.spread(column.key).median
    if reference is None or not math.isfinite(base):
        return [text, UNKNOWN]
    return [text, number(group.spread(column.key).median / base, 2) + _bootstrap_interval(group, reference, column.key)]


def _bootstrap_interval(group: Group, reference: Group, key: str) -> str:
    """Bootstrap 95 % interval of the ratio of medians, over pairs of runs that differ only in the method; "" for few
    pairs.
    """
    others = {_without_method(row): value for row, value in zip(reference.rows, reference.values(key), strict=True)}
    own = [(value, _without_method(row)) for row, value in zip(group.rows, group.values(key), strict=True)]
    pairs = np.array([(value, others[run]) for value, run in own if run in others])
    if group is reference or len(pairs) < LEAST_PAIRS or not np.isfinite(pairs[:, 1]).all():
        return ""
    drawn = np.random.default_rng(0).integers(len(pairs), size=(_DRAWS, len(pairs)))
    medians = np.sort(pairs[drawn], axis=1)[:, [(len(pairs) - 1) // 2, len(pairs) // 2]].mean(axis=1)
    low, high = np.sort(medians[:, 0] / medians[:, 1])[[int(0.025 * _DRAWS), int(0.975 * _DRAWS)]].tolist()
    return f" ({number(low, 2)} to {number(high, 2)})"


def _without_method(row: Row) -> tuple[Setting, int]:
    return tuple(pair for pair in row.cell.setting if pair[0] != "method"), row.cell.seed


def paired(group: Group, column: Column, groups: Sequence[Group]) -> Interval | None:
    """Mean difference of a figure to the same runs with nothing left out; None for the reference runs themselves."""
    if dict(group.setting).get(LEFT_OUT, NOTHING) == NOTHING:
        return None
    full = {_same_run(row): row for other in groups if other[LEFT_OUT] == NOTHING for row in other.rows}
    pairs = [(row, full[_same_run(row)]) for row in group.rows if _same_run(row) in full]
    return Interval.resampled([_of(row, column) - _of(other, column) for row, other in pairs]) if pairs else None


def _same_run(row: Row) -> tuple[Setting, int]:
    """The settings that a run shares with its reference run."""
    return tuple(pair for pair in row.cell.setting if pair[0] != LEFT_OUT), row.cell.seed


def _of(row: Row, column: Column) -> float:
    value = (row.figures or {}).get(column.key)
    found = math.inf if value is None else float(sum(value) if isinstance(value, list) else value)
    return min(found, column.most)


def _reference(group: Group, groups: Sequence[Group]) -> Group | None:
    wanted = {**dict(group.setting), "method": REFERENCE_METHOD}
    return next((other for other in groups if dict(other.setting) == wanted), None)


def _pool(group: Group, column: Column) -> str:
    values = group.pool(column.key)
    return " / ".join(number(quantile(values, share), column.digits) for share in (0.5, 0.95)) if values else UNKNOWN


def _rms(group: Group, column: Column) -> str:
    values = group.pool(column.key)
    return number(math.sqrt(sum(value**2 for value in values) / len(values)), column.digits) if values else UNKNOWN


def _within(group: Group, column: Column) -> str:
    values = group.pool(column.key)
    shares = [sum(abs(value) <= limit for value in values) / len(values) for limit in (1, 2, 3)] if values else []
    return " / ".join(f"{100 * share:.{column.digits}f}" for share in shares) or UNKNOWN


def _estimate(group: Group, column: Column) -> str:
    values = group.values(column.key)
    mean, count = sum(values) / len(values), len(values)
    if not math.isfinite(mean) or count < 2:
        return number(mean, column.digits)
    error = math.sqrt(sum((value - mean) ** 2 for value in values) / (count - 1) / count)
    return f"{number(mean, column.digits)} ± {number(error, column.digits)}"


def correlation(pairs: Sequence[Sequence[float]]) -> float | None:
    """Pearson's correlation of pairs of numbers; None if there are too few or one of them is constant."""
    if len(pairs) < 3:
        return None
    means = [sum(pair[side] for pair in pairs) / len(pairs) for side in (0, 1)]
    spreads = [[pair[side] - means[side] for pair in pairs] for side in (0, 1)]
    lengths = [math.sqrt(sum(value**2 for value in spread)) for spread in spreads]
    if min(lengths) == 0.0:
        return None
    return float(sum(one * other for one, other in zip(*spreads, strict=True)) / (lengths[0] * lengths[1]))


def _correlation(group: Group, column: Column) -> str:
    found = correlation(group.pairs(column.key))
    return UNKNOWN if found is None else number(found, column.digits)


def _percent(group: Group, column: Column) -> str:
    values = [value for value in group.values(column.key) if math.isfinite(value)]
    return f"{100 * sum(values) / len(values):.{column.digits}f} %" if values else UNKNOWN


def _shares(group: Group, column: Column) -> str:
    found = [shares for row in group.rows if (shares := (row.figures or {}).get(column.key))]
    means = [sum(values) / len(values) for values in zip(*found, strict=True)]
    return " / ".join(f"{100 * mean:.{column.digits}f}" for mean in means) or UNKNOWN


def _sum(group: Group, column: Column) -> str:
    values = [value for value in group.values(column.key) if math.isfinite(value)]
    return number(sum(values), column.digits) if values else UNKNOWN


_SHOWN: Mapping[Kind, Callable[[Group, Column], str]] = {
    "spread": lambda group, column: group.spread(column.key).text(column.digits),
    "mean": lambda group, column: number(sum(values := group.values(column.key)) / len(values), column.digits),
    "estimate": _estimate,
    "correlation": _correlation,
    "median": lambda group, column: number(group.spread(column.key).median, column.digits),
    "pooled": _pool,
    "rms": _rms,
    "within": _within,
    "percent": _percent,
    "sum": _sum,
    "shares": _shares,
}


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """Header and body as a Markdown table; the last column is text, the others are numbers or names."""
    head, *body = rows
    lines = [head, ["---", *["---:"] * (len(head) - 2), "---"], *body]
    return "".join(
        "| " + " | ".join(" ".join(cell.replace("|", "\\|").split()) for cell in row) + " |\n" for row in lines
    )


def group_json(group: Group, columns: Sequence[Column]) -> dict[str, Any]:
    """A group as plain data: setting, numbers of runs, failures, and the spread of every figure of the table."""
    spreads = {column.key: _figure_json(group, column) for column in columns}
    failures = [{"seed": seed, "reason": reason} for seed, reason in group.failures]
    return {"setting": dict(group.setting), "runs": len(group.rows), "failures": failures, "figures": spreads}


def _figure_json(group: Group, column: Column) -> Any:
    if column.kind == "correlation":
        return {"correlation": correlation(group.pairs(column.key))}
    if column.kind == "estimate":
        return {**group.spread(column.key).as_json(), "text": _estimate(group, column)}
    if column.kind == "paired":
        return [_of(row, column) for row in group.rows]
    if column.kind in ("shares", "rms", "within"):
        return {"text": _SHOWN[column.kind](group, column)}
    if column.kind != "pooled":
        return group.spread(column.key).as_json()
    values = group.pool(column.key)
    return {"median": quantile(values, 0.5), "p95": quantile(values, 0.95), "max": max(values)} if values else None
