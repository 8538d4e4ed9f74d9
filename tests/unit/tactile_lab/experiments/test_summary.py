"""Tables and plots of runs: spreads, failures and ratios."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from tactile_lab.evaluation.spread import Spread, quantile
from tactile_lab.experiments.catalogue import experiment
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.groups import Column, group_runs, varying_settings
from tactile_lab.experiments.plot_data import CurvePanel, Plot, Series
from tactile_lab.experiments.plots import draw
from tactile_lab.experiments.reporting import document, part_of, write_report
from tactile_lab.experiments.results.claims import numbers_in
from tactile_lab.experiments.summary import markdown, reasons, short_table, table

COLUMN = Column("Hausdorff, mm", "hausdorff_mm", 1, versus=True)


def row(method: str, seed: int, hausdorff: float | None, registration: float = 1.0, shape: str = "L") -> Row:
    cell = Cell((("noise", 100), ("outliers", 0), ("shape", shape), ("method", method), ("grasps", 16)), seed)
    figures = {"hausdorff_mm": hausdorff, "registration_mm": registration, "step_ms": [1.0, 3.0], "within_2_sigma": 0.9}
    return Row(cell, {**figures, "mean_mm": hausdorff, "finish_ms": 5.0})


ROWS = [
    *(row("known-pose", seed, 1.0 + seed) for seed in range(3)),
    *(row("joint", seed, 2.0 + 2 * seed, registration=4.0 + seed) for seed in range(3)),
    Row(row("odometry", 0, 1.0).cell, None, "nothing | fits"),
    row("odometry", 1, 3.0),
    row("odometry", 2, None),
]


def test_quantiles_are_numpy_s_and_infinite_where_runs_have_no_figure() -> None:
    values = [3.0, 1.0, 4.0, 1.5, 9.0, 2.0]
    for share in (0.0, 0.5, 0.9, 1.0):
        assert quantile(values, share) == pytest.approx(np.quantile(values, share))
    assert quantile([1.0, math.inf], 0.5) == math.inf
    assert quantile([1.0, 2.0, math.inf], 0.5) == 2.0
    assert Spread.of([1.0, math.inf]).as_json() == {"median": None, "p90": None, "max": None}


def test_a_table_shows_spreads_ratios_and_failures() -> None:
    head, known, joint, odometry = table(group_runs(ROWS), [COLUMN], {})
    assert head == ["method", "runs", "Hausdorff, mm", "× known-pose", "failed", "why"]
    assert known == ["known-pose", "3", "2.0 / 2.8 / 3.0", "1.00", "0", ""]
    assert joint[2:] == ["4.0 / 5.6 / 6.0", "2.00", "1 (33 %)", "registration above 5 mm: 1 (2)"]
    assert odometry[2] == "∞ / ∞ / ∞"
    assert odometry[3] == "∞"
    assert reasons(group_runs(ROWS)[2]) == "nothing | fits: 1 (0); no shape: 1 (2)"


def test_settings_may_be_taken_together() -> None:
    rows = [row("joint", 0, 1.0, shape="L"), row("joint", 0, 3.0, shape="ellipse")]
    assert len(group_runs(rows)) == 2
    (both,) = group_runs(rows, over=("shape",))
    assert both.spread("hausdorff_mm").median == 2.0
    assert both.pool("step_ms") == [1.0, 3.0, 1.0, 3.0]
    assert varying_settings(group_runs(rows)) == ["shape"]


def test_the_table_of_a_terminal_has_two_figures() -> None:
    head, *body = short_table(group_runs(ROWS), [COLUMN, Column("mean, mm", "mean_mm"), Column("x", "x")])
    assert head == ["method", "Hausdorff, mm", "× known-pose", "mean, mm", "failed"]
    assert body[1][-1] == "1 of 3"


def test_markdown_cells_can_not_break_the_table() -> None:
    text = markdown(table(group_runs(ROWS), [COLUMN], {}))
    assert "nothing \\| fits" in text
    assert {line.replace("\\|", "").count("|") for line in text.splitlines()} == {7}


@pytest.mark.parametrize("name", ["methods-2d", "figure-3.12", "figure-3.16"])
def test_an_outcome_is_written_as_data_table_and_plot(name: str, tmp_path: Path) -> None:
    study = experiment(name)
    write_report(study, ROWS, tmp_path, jobs=2)
    assert {path.name for path in tmp_path.iterdir()} == {"results.json", "results.md", "plot.svg"}
    root = ElementTree.fromstring((tmp_path / "plot.svg").read_text())
    assert root.tag.endswith("svg")
    assert "known-pose" in "".join(root.itertext())
    found = document(study, ROWS, jobs=2)
    assert found["seeds"] == [0, 1, 2]
    assert found["groups"][1]["failures"] == [{"seed": 2, "reason": "registration above 5 mm"}]
    assert found["groups"][2]["figures"]["hausdorff_mm"]["max"] is None
    assert "Seeds 0-2; 9 runs" in (tmp_path / "results.md").read_text()


def test_a_curve_leaves_out_points_without_a_median() -> None:
    series = Series("joint", (1.0, 2.0), (3.0, math.inf), (4.0, math.inf))
    text = draw("title", Plot((CurvePanel("panel", "x", "y", (series,)),)))
    assert text.count("<title>joint, ") == 1
    assert "inf" not in text
    assert "nan" not in text


def test_curves_differ_without_their_colours() -> None:
    lines = tuple(Series(name, (1.0, 2.0), (3.0, 3.0), (4.0, 4.0)) for name in ("joint", "icp", "odometry"))
    text = draw("title", Plot((CurvePanel("panel", "x", "y", lines),)))
    drawn = [path for path in text.split("<path ")[1:] if 'class="line"' in path and "L" in path.split(' d="')[1]]
    dashes = {path.partition("stroke-dasharray")[2][:8] for path in drawn}
    assert len(dashes) == len(lines)


def test_a_ratio_of_many_pairs_of_runs_has_an_interval() -> None:
    known = [row("known-pose", seed, 1.0 + 0.1 * (seed % 5)) for seed in range(40)]
    joint = [row("joint", seed, 2.0 + 0.3 * (seed % 7)) for seed in range(40)]
    ratios = [cells[3] for cells in table(group_runs([*known, *joint]), [COLUMN], {})[1:]]
    assert ratios[0] == "1.00"
    ratio, low, high = numbers_in(ratios[1])
    assert low < ratio < high
    assert high < 3.8 / 1.0
    assert table(group_runs([*known, *joint[:19]]), [COLUMN], {})[2][3].count("to") == 0


def test_runs_of_a_kind_stand_together() -> None:
    study = experiment("methods-3d")
    rows = [row(method, 0, 1.0, shape=shape) for shape in ("mug", "sphere") for method in ("known-pose", "joint")]
    pooled, kinds, single = part_of(study, rows, 1, "").tables
    assert [line[0] for line in pooled.rows] == ["known-pose", "joint"]
    assert [kinds.key(line) for line in kinds.rows] == [
        (k, m) for k in ("mugs", "curved") for m in ("known-pose", "joint")
    ]
    assert single.head[:3] == ("shape", "method", "runs")


def test_pooled_numbers_have_a_root_mean_square_and_shares_within_one_two_and_three() -> None:
    rows = [Row(row("joint", seed, 1.0).cell, {"off": off}) for seed, off in ((0, [0.5, -1.5]), (1, [2.5, 4.0]))]
    columns = [Column("rms", "off", 2, kind="rms"), Column("within", "off", 0, kind="within")]
    assert table(group_runs(rows), columns, {})[1][-4:-2] == ["2.49", "25 / 50 / 75"]
    empty = [Row(rows[0].cell, {"off": []})]
    assert table(group_runs(empty), columns, {})[1][-4:-2] == ["–", "–"]
