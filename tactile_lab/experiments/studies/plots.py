"""Plots that several experiments share: curves over one setting, spreads by another."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tactile_lab.evaluation.spread import quantile
from tactile_lab.experiments.cells import Cell, Row, Value
from tactile_lab.experiments.experiment import PlotOf
from tactile_lab.experiments.groups import Group, group_runs
from tactile_lab.experiments.plot_data import CurvePanel, Plot, Range, RangePanel, Series

UNITS = {"noise": "%", "outliers": "%"}
LOGARITHMIC = {"particles"}
HAUSDORFF_LABEL = "Hausdorff at best fit, mm"


def _by(rows: Sequence[Row], name: str) -> dict[Value, list[Row]]:
    """Rows by a value of their setting, in order of appearance."""
    parts: dict[Value, list[Row]] = {}
    for row in rows:
        parts.setdefault(row.cell[name], []).append(row)
    return parts


def curves(x: str, x_label: str, panel: str, line: str, *, columns: int = 2, key: str = "hausdorff_mm") -> PlotOf:
    """Error against the setting ``x``: a chart for each value of ``panel``, a curve for each of ``line``."""

    def plot(rows: Sequence[Row]) -> Plot:
        panels = []
        for name, part in _by(rows, panel).items():
            series = [
                _curve_of(str(value), group_runs(lines, over=_others(lines, x)), x, key)
                for value, lines in _by(part, line).items()
            ]
            panels.append(CurvePanel(_title(panel, name), x_label, HAUSDORFF_LABEL, tuple(series), x in LOGARITHMIC))
        return Plot(tuple(panels), columns)

    return plot


def ranges(line: str, label: str, key: str, panel_of: Callable[[Cell], str], *, columns: int = 2) -> PlotOf:
    """Spreads: a chart for each panel, a line for each value of the setting ``line``."""

    def plot(rows: Sequence[Row]) -> Plot:
        parts: dict[str, list[Row]] = {}
        for row in rows:
            parts.setdefault(panel_of(row.cell), []).append(row)
        panels = []
        for name, part in parts.items():
            found = [(str(value), lines) for value, lines in _by(part, line).items()]
            shown = [_range_of(value, group_runs(lines, over=_others(lines, line))[0], key) for value, lines in found]
            panels.append(RangePanel(name, label, tuple(shown)))
        return Plot(tuple(panels), columns)

    return plot


def _curve_of(name: str, groups: Sequence[Group], x: str, key: str) -> Series:
    """The curve of groups that differ in the setting ``x``, in its order."""
    ordered = sorted(groups, key=lambda group: float(group[x]))
    values = [group.values(key) for group in ordered]
    medians, p90s = (tuple(quantile(found, share) for found in values) for share in (0.5, 0.9))
    return Series(name, tuple(float(group[x]) for group in ordered), medians, p90s)


def _range_of(name: str, group: Group, key: str) -> Range:
    spread = group.spread(key)
    return Range(name, spread.median, spread.p90, spread.largest, f"{100 * group.failed_share:.0f} % fail")


def _others(rows: Sequence[Row], kept: str) -> list[str]:
    return [name for name, _ in rows[0].cell.setting if name != kept]


def _title(name: str, value: Value) -> str:
    if name == "grasps":
        return f"{value} grasps"
    return f"{name} {value} {UNITS[name]}" if name in UNITS else str(value)


def condition(cell: Cell) -> str:
    outliers = f", {cell['outliers']} % outliers" if cell["outliers"] else ""
    return f"{cell['noise']} % motion noise{outliers}"
