"""Methods beside one another: spreads, confidence intervals, differences session by session, table, CSV and plot."""

from __future__ import annotations

import csv
import io
import xml.etree.ElementTree as ElementTree
from typing import Any

import pytest

from tactile_lab.evaluation.comparison import EvaluatedRun, compare, markdown, rows_csv, short_table, table
from tactile_lab.evaluation.spread import Interval, Spread
from tactile_lab.report.comparison_plot import comparison_svg


def judged(session: str, method: str, rmse_mm: float | None, failed: bool = False) -> EvaluatedRun:
    content: dict[str, Any] = {
        "object": "box",
        "method": method,
        "dimension": 2,
        "seed": 1,
        "grasps": 12,
        "status": "ok",
        "failed": failed,
        "pose": None if rmse_mm is None else {"rmse_mm": rmse_mm, "rmse_deg": 1.0},
    }
    return EvaluatedRun(session, "results", content)


EVALUATIONS = [
    *(judged(name, "joint", value) for name, value in (("a", 1.0), ("b", 2.0), ("c", 6.0))),
    *(judged(name, "icp", value, True) for name, value in (("a", 1.5), ("b", 2.4), ("c", 6.6))),
]


def test_an_interval_is_students() -> None:
    interval = Interval.of([1.0, 2.0, 6.0])
    assert interval.mean == pytest.approx(3.0)
    assert interval.low == pytest.approx(3.0 - 4.303 * 2.6458 / 3**0.5, abs=1e-3)
    assert interval.high == pytest.approx(3.0 + 4.303 * 2.6458 / 3**0.5, abs=1e-3)
    assert Interval.of([4.0]) == Interval(4.0, None, None)
    assert Interval.of([4.0]).text() == "4.0"


def test_methods_are_gathered_and_compared_with_the_first_session_by_session() -> None:
    joint, icp = compare(EVALUATIONS)
    assert (joint.method, joint.runs, joint.failed, icp.failed) == ("joint, 2-D", 3, 0, 3)
    position = joint.figures[2]
    assert position.spread == Spread.of([1.0, 2.0, 6.0])
    assert position.against_first is None
    difference = icp.figures[2].against_first
    assert difference is not None
    assert difference.mean == pytest.approx(0.5)
    assert difference.low is not None
    assert difference.low > 0.2, "the sessions' own spread is much larger than that of the differences"


def test_results_of_one_method_on_one_session_are_no_further_runs_of_it() -> None:
    again = [EvaluatedRun(each.session, "other settings", each.evaluation) for each in EVALUATIONS[:3]]
    first, other, icp = compare([*EVALUATIONS[:3], *again, *EVALUATIONS[3:]])
    names = (first.method, other.method, icp.method)
    assert names == ("joint, 2-D, results", "joint, 2-D, other settings", "icp, 2-D")
    assert [summary.runs for summary in (first, other, icp)] == [3, 3, 3]


def test_what_nobody_knows_is_left_out_and_what_some_know_is_counted() -> None:
    (only,) = compare([judged("a", "joint", None), judged("b", "joint", 2.0)])
    assert only.figures[2].count == 1
    assert only.figures[0].spread is None
    assert all("Hausdorff" not in line[1] for line in table([only])[1:])


def test_rows_go_to_csv_one_an_evaluation() -> None:
    rows = list(csv.DictReader(io.StringIO(rows_csv([*EVALUATIONS, judged("d", "icp", None)]))))
    assert len(rows) == 7
    assert rows[0]["pose.rmse_mm"] == "1"
    assert rows[6]["pose.rmse_mm"] == ""
    assert rows[3]["method"] == "icp, 2-D"


def test_tables_and_plot_name_every_method() -> None:
    summaries = compare(EVALUATIONS)
    text = markdown(summaries)
    assert text.count("joint, 2-D") == 2
    assert len(short_table(summaries)[0]) == 5
    svg = comparison_svg(summaries)
    root = ElementTree.fromstring(svg)
    assert sum(element.tag.endswith("circle") for element in root.iter()) == 4
    bars = [element for element in root.iter() if element.get("class") == "bar"]
    assert len(bars) == 4
    assert min(figure.mean.low for one in summaries for figure in one.figures if figure.mean) < 0.0
    assert min(float(bar.get("x1", "nan")) for bar in bars) == 170.0  # no error is below zero


def test_an_interval_excludes_zero_on_either_side_by_more_than_the_margin() -> None:
    above, below, around = Interval(3.0, 2.0, 4.0), Interval(-3.0, -4.0, -2.0), Interval(0.5, -1.0, 2.0)
    assert [one.excludes_zero() for one in (above, below, around)] == [True, True, False]
    assert [one.excludes_zero(1.0) for one in (above, below, around)] == [True, True, False]
    assert [one.excludes_zero(2.5) for one in (above, below, around)] == [False, False, False]
    assert not Interval(3.0, None, None).excludes_zero()


FULL: dict[str, Any] = {
    "object": "box",
    "method": "joint",
    "dimension": 3,
    "seed": 7,
    "grasps": 12,
    "status": "partial",
    "failed": None,
    "shape_best_fit": {"hausdorff_mm": 3.25, "mean_distance_mm": 0.5},
    "pose": {"rmse_mm": 1.5, "rmse_deg": 2.5},
    "pose_umeyama": {"rmse_mm": 1.25},
    "consistency": {"poses": {"inside": [0.25, 0.5, 0.75]}, "surface": {"inside": [0.1, 0.2, 0.9]}},
    "registration_rms_mm": 0.75,
    "sensing": {"median_mm": 0.3},
}
VALUES = [3.25, 0.5, 1.5, 2.5, 1.25, 0.75, 0.9, 0.75, 0.3]


def test_every_figure_is_found_in_an_evaluation() -> None:
    (only,) = compare([EvaluatedRun("a", "results", FULL)])
    assert [figure.mean.mean for figure in only.figures if figure.mean] == VALUES
    assert [figure.count for figure in only.figures] == [1] * 9
    (line,) = csv.DictReader(io.StringIO(rows_csv([EvaluatedRun("a", "results", FULL)])))
    head = {"session": "a", "results": "results", "object": "box", "method": "joint, 3-D", "seed": "7"}
    assert line | head | {"grasps": "12", "status": "partial", "failed": ""} == line
    assert [float(value) for value in list(line.values())[8:]] == VALUES


@pytest.mark.parametrize("inside", [[], [0.25, 0.5], None, {"2": 0.5}])
def test_a_place_that_a_list_does_not_have_is_unknown(inside: Any) -> None:
    run = EvaluatedRun("a", "results", FULL | {"consistency": {"poses": {"inside": inside}}})
    assert run.figure(("consistency", "poses", "inside", 2)) is None
    assert run.figure(("consistency", "poses", "inside", 2, "deeper")) is None


def test_a_table_has_a_line_for_each_method_and_figure() -> None:
    runs = [
        judged("a", "joint", 1.0),
        judged("b", "joint", 2.0),
        judged("a", "icp", 1.5, True),
        judged("b", "icp", 2.5),
    ]
    head, first, _, second, _ = table(compare(runs))
    assert head == [
        *("method", "figure", "n", "median / p90 / max", "mean [95 %]", "relative to the first [95 %]", "failed")
    ]
    assert first == [
        *("joint, 2-D", "position RMSE, mm", "2", "1.50 / 1.90 / 2.00", "1.50 [-4.85, 7.85]", "\u2013", "0 of 2")
    ]
    spread, mean = "2.00 / 2.40 / 2.50", "2.00 [-4.35, 8.35]"
    assert second == ["icp, 2-D", "position RMSE, mm", "2", spread, mean, "0.50 [0.50, 0.50]", "1 of 2"]
    assert short_table(compare(runs))[1] == [first[0], first[1], first[2], first[4], first[5]]
    assert markdown(compare(runs)).splitlines()[1:3] == [
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
        f"| {' | '.join(first)} |",
    ]


def test_sessions_that_the_first_method_has_not_are_not_compared() -> None:
    runs = [judged("a", "joint", 1.0), judged("b", "joint", None), judged("a", "icp", 4.0), judged("b", "icp", 9.0)]
    _, icp = compare([*runs, judged("c", "icp", 9.0)])
    assert icp.figures[2].count == 3
    assert icp.figures[2].against_first == Interval(3.0, None, None)
