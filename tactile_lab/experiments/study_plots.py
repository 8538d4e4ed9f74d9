"""Plots that several experiments share: curves over one setting, spreads by another."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tactile_lab.experiments.cells import Cell, Row, Value
from tactile_lab.experiments.experiment import Plot
from tactile_lab.experiments.plots import CurvePanel, RangePanel, curve_of, curves_svg, ranges_svg
from tactile_lab.experiments.summary import grouped

UNITS = {"noise": "%", "outliers": "%"}
LOGARITHMIC = {"particles"}
HAUSDORFF_LABEL = "Hausdorff at best fit, mm"


def _by(rows: Sequence[Row], name: str) -> dict[Value, list[Row]]:
    """Rows by a value of their setting, in order of appearance."""
    parts: dict[Value, list[Row]] = {}
    for row in rows:
        parts.setdefault(row.cell[name], []).append(row)
    return parts


def curves(x: str, x_label: str, panel: str, line: str, *, columns: int = 2, key: str = "hausdorff_mm") -> Plot:
    """Error against the setting ``x``: a chart for each value of ``panel``, a curve for each of ``line``."""

    def plot(title: str, rows: Sequence[Row]) -> str:
        panels = []
        for name, part in _by(rows, panel).items():
            series = [
                curve_of(str(value), grouped(lines, over=_others(lines, x)), x, key)
                for value, lines in _by(part, line).items()
            ]
            panels.append(CurvePanel(_titled(panel, name), x_label, HAUSDORFF_LABEL, series, x in LOGARITHMIC))
        return curves_svg(title, panels, columns)

    return plot


def ranges(line: str, label: str, key: str, panel_of: Callable[[Cell], str], *, columns: int = 2) -> Plot:
    """Spreads: a chart for each panel, a line for each value of the setting ``line``."""

    def plot(title: str, rows: Sequence[Row]) -> str:
        parts: dict[str, list[Row]] = {}
        for row in rows:
            parts.setdefault(panel_of(row.cell), []).append(row)
        panels = []
        for name, part in parts.items():
            found = [(str(value), lines) for value, lines in _by(part, line).items()]
            groups = [(value, grouped(lines, over=_others(lines, line))[0]) for value, lines in found]
            panels.append(RangePanel(name, label, key, groups))
        return ranges_svg(title, panels, columns)

    return plot


def _others(rows: Sequence[Row], kept: str) -> list[str]:
    return [name for name, _ in rows[0].cell.setting if name != kept]


def _titled(name: str, value: Value) -> str:
    if name == "grasps":
        return f"{value} grasps"
    return f"{name} {value} {UNITS[name]}" if name in UNITS else str(value)


def condition(cell: Cell) -> str:
    outliers = f", {cell['outliers']} % outliers" if cell["outliers"] else ""
    return f"{cell['noise']} % motion noise{outliers}"
