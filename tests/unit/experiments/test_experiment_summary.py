"""Tables and plots of runs: spreads, failures, ratios, and the place in a document."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from tactile_lab.errors import SessionError
from tactile_lab.evaluation.spread import Spread, quantile
from tactile_lab.experiments.catalogue import EXPERIMENTS, experiment
from tactile_lab.experiments.cells import Cell, Row
from tactile_lab.experiments.plots import CurvePanel, Series, curves_svg
from tactile_lab.experiments.reporting import document, insert_section, write_report
from tactile_lab.experiments.summary import (
    Column,
    grouped,
    markdown,
    reasons,
    short_table,
    table,
    varied,
)

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
    head, known, joint, odometry = table(grouped(ROWS), [COLUMN], {})
    assert head == ["method", "runs", "Hausdorff, mm", "× known-pose", "failed", "why"]
    assert known == ["known-pose", "3", "2.0 / 2.8 / 3.0", "1.00", "0", ""]
    assert joint[2:] == ["4.0 / 5.6 / 6.0", "2.00", "1 (33 %)", "registration above 5 mm: 1 (2)"]
    assert odometry[2] == "∞ / ∞ / ∞"
    assert odometry[3] == "∞"
    assert reasons(grouped(ROWS)[2]) == "nothing | fits: 1 (0); no shape: 1 (2)"


def test_settings_may_be_taken_together() -> None:
    rows = [row("joint", 0, 1.0, shape="L"), row("joint", 0, 3.0, shape="ellipse")]
    assert len(grouped(rows)) == 2
    (both,) = grouped(rows, over=("shape",))
    assert both.spread("hausdorff_mm").median == 2.0
    assert both.pooled("step_ms") == [1.0, 3.0, 1.0, 3.0]
    assert varied(grouped(rows)) == ["shape"]


def test_the_table_of_a_terminal_has_two_figures() -> None:
    head, *body = short_table(grouped(ROWS), [COLUMN, Column("mean, mm", "mean_mm"), Column("x", "x")])
    assert head == ["method", "Hausdorff, mm", "× known-pose", "mean, mm", "failed"]
    assert body[1][-1] == "1 of 3"


def test_markdown_cells_can_not_break_the_table() -> None:
    text = markdown(table(grouped(ROWS), [COLUMN], {}))
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
    series = Series("joint", np.array([1.0, 2.0]), np.array([3.0, math.inf]), np.array([4.0, math.inf]))
    text = curves_svg("title", [CurvePanel("panel", "x", "y", [series])])
    assert text.count('class="dot"') == 1
    assert "inf" not in text
    assert "nan" not in text


def test_a_section_replaces_what_is_between_its_marks(tmp_path: Path) -> None:
    page, study = tmp_path / "results.md", EXPERIMENTS["methods-2d"]
    page.write_text("# Results\n\n<!-- experiment methods-2d -->\nold\n<!-- end methods-2d -->\n\nafter\n")
    insert_section(page, study, ROWS, 1)
    insert_section(page, study, ROWS, 1)
    text = page.read_text()
    assert "old" not in text
    assert text.count("| joint |") == 1
    assert text.count("(pictures/methods-2d.svg)") == 1
    assert (tmp_path / "pictures" / "methods-2d.svg").is_file()
    assert text.startswith("# Results")
    assert text.endswith("\n\nafter\n")
    with pytest.raises(SessionError, match=r"no place for figure-3\.12"):
        insert_section(page, EXPERIMENTS["figure-3.12"], ROWS, 1)
    with pytest.raises(SessionError, match="can not be read"):
        insert_section(tmp_path / "none.md", study, ROWS, 1)
