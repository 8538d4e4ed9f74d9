"""The figures of a group of runs as texts and as plain data, each kind of column in its own way."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tactile_lab.evaluation.spread import Interval, number, quantile
from tactile_lab.experiments.cells import Row, Setting
from tactile_lab.experiments.groups import LEFT_OUT, NOTHING, REFERENCE_METHOD, Column, Group, Kind

UNKNOWN = "–"
LEAST_PAIRS, _DRAWS = 20, 2000
"""Smallest number of pairs for the interval of a ratio, and the number of bootstrap samples."""


def titles(column: Column) -> list[str]:
    """Headings of a column: its own, and that of the ratio to the reference method."""
    return [column.title, f"× {REFERENCE_METHOD}"] if column.versus else [column.title]


def texts(group: Group, column: Column, groups: Sequence[Group]) -> list[str]:
    """What a column shows of a group, a text for each of its titles.

    Args:
        groups: all of the table, the reference method's among them.
    """
    if column.kind == "paired":
        found = paired(group, column, groups)
        return [UNKNOWN if found is None else found.text(column.digits)]
    text = _SHOWN[column.kind](group, column)
    if not column.versus:
        return [text]
    reference = _reference(group, groups)
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


def figure_json(group: Group, column: Column) -> Any:
    """A figure of a group as plain data."""
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
