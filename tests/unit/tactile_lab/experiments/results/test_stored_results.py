"""Stored results: files, parts of several versions, pages that say which version made them, and claims."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.core.errors import ConfigurationError, SessionError
from tactile_lab.experiments.plot_data import CurvePanel, Plot, Range, RangePanel, Series
from tactile_lab.experiments.results import claims
from tactile_lab.experiments.results.claims import Goal, Panel, Place, find, judge_goal, numbers_in
from tactile_lab.experiments.results.page_ages import CURRENT, OLDER, answer, answer_overview
from tactile_lab.experiments.results.pages import merge_plots, page
from tactile_lab.experiments.results.stored_result import MadeBy, Part, StoredResult, Table
from tactile_lab.experiments.results.storing import combine, partial_rows, store

HEAD = ("method", "shape", "runs", "Hausdorff, mm", "failed")
POOLED = Table(
    "All", ("method", "runs", "Hausdorff, mm", "failed"), (("joint", "30", "1.0 / 2.0 / 3.0", "3 (10 %)"),), 1
)
OLD = MadeBy("0.1.0", None, "d33d489", "2026-11-23", "2 cores")
NOW = MadeBy("0.2.0", "aaaa", None, "2026-12-01", "4 cores")


def made(by: MadeBy, *rows: tuple[str, str], plot: Plot | None = None, command: str = "run") -> Part:
    cells = tuple((method, shape, "2", f"{by.program}", "0") for method, shape in rows)
    return Part(by, (command,), "", (Table("", HEAD, cells, 2),), plot)


def ranges(*names: str) -> Plot:
    return Plot((RangePanel("all", "mm", tuple(Range(name, 1.0, 2.0, math.inf, "0 % fail") for name in names)),))


def test_a_result_is_what_it_was_after_the_file(tmp_path: Path) -> None:
    curves = Plot(
        (CurvePanel("L", "x", "y", (Series("joint", (1.0, 2.0), (0.5, math.inf), (1.0, math.inf)),), True),), 1
    )
    parts = (replace(made(NOW, ("joint", "L")), plot=curves), made(OLD, ("icp", "a | b"), plot=ranges("icp")))
    result = StoredResult("test", "It is shown.", parts)
    file = result.write(tmp_path)
    assert StoredResult.read(file) == result
    assert '"joint", "L", "2"' in file.read_text()  # a row stands on one line
    for damage in ('{"format": 1}', "", file.read_text().replace('"keys"', '"other"'), file.read_text()[:-20]):
        file.write_text(damage)
        with pytest.raises(SessionError, match="not a stored result"):
            StoredResult.read(file)


def test_a_row_that_is_too_short_is_refused() -> None:
    table = {"title": "t", "head": ["a", "b"], "rows": [["1"]], "keys": 1}
    with pytest.raises(ValueError, match="not as long"):
        Table.from_json(table)


def test_new_rows_replace_those_of_the_same_settings_and_the_others_stay() -> None:
    older = made(OLD, ("joint", "L"), ("icp", "L"), ("joint", "U"))
    new, left = combine(made(NOW, ("joint", "L"), ("joint", "U")), (older,))
    assert new.made_by == NOW
    assert [row[:2] for row in left.tables[0].rows] == [("icp", "L")]
    assert combine(made(NOW, ("joint", "L"), ("icp", "L"), ("joint", "U")), (older,)) == (
        made(NOW, ("joint", "L"), ("icp", "L"), ("joint", "U")),
    )


def test_rows_replace_those_of_the_same_settings_that_told_something_else() -> None:
    told = Table("", (*HEAD[:2], "only this"), (("joint", "L", "1"), ("icp", "L", "2")), 2)
    older = replace(made(OLD, ("joint", "L")), tables=(told,))
    (left,) = combine(made(NOW, ("joint", "L")), (older,))[1].tables
    assert left.rows == (("icp", "L", "2"),)


def test_tables_with_other_columns_stay() -> None:
    older = replace(made(OLD, ("joint", "L")), tables=(POOLED,))
    assert combine(made(NOW, ("joint", "L")), (older,))[1].tables == (POOLED,)


def together(by: MadeBy, *rows: tuple[str, str]) -> Part:
    """A part with a row for each method, of all its shapes."""
    part = made(by, *rows)
    methods = {method: sum(one == method for one, _ in rows) for method, _ in rows}
    pooled = tuple((method, str(count)) for method, count in methods.items())
    return replace(part, tables=(Table("All values of shape together", ("method", "runs"), pooled), *part.tables))


def test_a_row_of_all_shapes_is_replaced_only_by_one_of_as_many(tmp_path: Path) -> None:
    older = together(OLD, ("joint", "L"), ("joint", "U"), ("icp", "L"), ("icp", "U"))
    some = together(NOW, ("joint", "L"), ("joint", "U"), ("icp", "L"))
    new, left = combine(some, (older,))
    assert new.tables[0].rows == (("joint", "2"),)
    assert [table.rows for table in left.tables] == [(("icp", "2"),), (("icp", "U", "2", "0.1.0", "0"),)]
    more = together(NOW, ("joint", "L"), ("joint", "U"), ("joint", "O"))
    assert combine(more, (older,))[0].tables[0].rows == (("joint", "3"),)
    later = replace(NOW, sources="bbbb")
    rest = combine(together(later, ("icp", "U")), combine(some, (older,)))
    assert [row for part in rest for row in part.tables[0].rows if len(row) == 2] == [("joint", "2"), ("icp", "2")]
    assert rest[0].tables[0].title == ""
    (tmp_path / "results" / "data").mkdir(parents=True)
    assert partial_rows(tmp_path, "test", some) == []
    store(tmp_path, "test", "s.", older)
    assert partial_rows(tmp_path, "test", some) == ["icp"]


def test_commands_of_the_same_version_are_collected() -> None:
    first = combine(made(NOW, ("joint", "L"), command="one"), ())
    (both,) = combine(made(NOW, ("joint", "L"), ("icp", "L"), command="two"), first)
    assert both.commands == ("one", "two")
    later = MadeBy("0.2.0", "bbbb", None, "2026-12-02", "4 cores")
    assert combine(made(later, ("joint", "L"), command="two"), first)[0].commands == ("two",)


def test_store_needs_a_folder_of_results(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="no stored results"):
        store(tmp_path, "test", "s.", made(NOW, ("joint", "L")))
    (tmp_path / "results" / "data").mkdir(parents=True)
    store(tmp_path, "test", "s.", made(OLD, ("icp", "L")))
    file = store(tmp_path, "test", "s.", made(NOW, ("joint", "L")))
    assert len(StoredResult.read(file).parts) == 2
    store(tmp_path, "test", "s.", made(NOW, ("joint", "L")), forget=True)
    assert len(StoredResult.read(file).parts) == 1


def test_a_page_says_when_and_by_which_version_each_part_was_made() -> None:
    result = StoredResult("test", "It is shown.", (made(NOW, ("joint", "L")), made(OLD, ("icp", "a | b"))))
    fresh, earlier = page(result).split("## Made earlier")
    assert "by sources aaaa, version 0.2.0" in fresh
    assert "by commit d33d489" in earlier
    assert "a \\| b" in earlier


def test_where_a_page_is_read_each_part_is_current_or_older() -> None:
    result = StoredResult("test", "It is shown.", (made(NOW, ("joint", "L")), made(OLD, ("icp", "b"))))
    fresh, earlier = answer(page(result), "aaaa").split("## Made earlier")
    assert CURRENT in fresh
    assert OLDER in earlier
    assert answer(page(result), "bbbb").count(OLDER) == 2
    assert answer_overview("| 1 mm | met | aaaa111 |", "aaaa111") == "| 1 mm | met | this version |"
    assert answer_overview("| 1 mm | met | aaaa111 |", "bbbb111") == "| 1 mm | met | older: aaaa111 |"


def test_notes_tell_when_the_figures_are_of_another_version() -> None:
    result = StoredResult("test", "It is shown.", (made(NOW, ("joint", "L")),))
    assert "Written about" not in page(result, "<!-- about: aaaa -->\n\nIt is good.\n")
    text = page(result, "<!-- about: d33d489 to 764f95f -->\n\nIt is good.\n")
    assert "*Written about the results of d33d489 to 764f95f:*\n\nIt is good.\n" in text
    assert "<!--" not in text


def test_lines_that_only_an_earlier_version_drew_have_a_star() -> None:
    parts = (made(NOW, plot=ranges("joint")), made(OLD, plot=ranges("icp", "joint")), made(OLD, plot=ranges("pf")))
    plot = merge_plots(parts)
    assert plot is not None
    assert [line.name for line in plot.panels[0].lines] == ["joint", "icp *", "pf *"]
    assert plot.key.count("*: by an earlier version") == 1
    assert merge_plots(parts[:1]) == ranges("joint")
    assert merge_plots((made(NOW),)) is None


def result_of(*parts: Part) -> dict[str, StoredResult]:
    return {"test": StoredResult("test", "s.", parts)}


def test_a_goal_takes_its_figure_from_the_newest_table_that_has_it() -> None:
    place = Place(result="test", where={"method": "joint"}, column="Hausdorff, mm")
    pooled, single = replace(made(OLD), tables=(POOLED,)), made(NOW, ("joint", "L"))
    results = result_of(single, pooled)
    assert find(place, results).part == pooled  # one shape does not stand for all
    newer = replace(made(NOW), tables=(replace(POOLED, rows=(("joint", "9", "1.5 / 2 / 3", "0"),)),))
    assert find(place, result_of(newer, pooled)).text == "1.5 / 2 / 3"
    with pytest.raises(ConfigurationError, match="no such row"):
        find(place.model_copy(update={"where": {"method": "icp"}}), results)
    with pytest.raises(ConfigurationError, match="no such row"):
        find(place.model_copy(update={"result": "other"}), results)


@pytest.mark.parametrize(
    ("asked", "more", "text", "verdict"),
    [
        (1.0, {}, "1.0 / 2.0 / 3.0 mm", "met"),
        (0.9, {}, "1.0 / 2.0 / 3.0 mm", "**missed**"),
        (1.9, {"number": 1}, "2 mm", "**missed**"),
        (2.5, {"number": 2, "at_least": True}, "3 mm", "met"),
        (None, {"number": 2}, "3 mm", ""),
    ],
)
def test_a_goal_is_met_or_missed_by_its_figure(
    asked: float | None, more: dict[str, int | bool], text: str, verdict: str
) -> None:
    place = Place(result="test", where={"method": "joint"}, column="Hausdorff, mm")
    goal = Goal.model_validate({"what": "w", "place": place, "unit": "mm", "asked": asked, **more})
    found = judge_goal(goal, result_of(replace(made(OLD), tables=(POOLED,))))
    assert (found.text, found.verdict) == (text, verdict)


def test_a_goal_may_be_a_share_or_a_ratio() -> None:
    place = Place(result="test", where={"method": "joint"}, column="failed")
    results = result_of(replace(made(OLD), tables=(POOLED,)))
    share = judge_goal(Goal(what="w", place=place, number=0, percent_of="runs", unit="%", asked=9.0), results)
    assert (share.text, share.verdict) == ("10 %", "**missed**")
    other = place.model_copy(update={"column": "runs"})
    assert judge_goal(Goal(what="w", place=other, over=place, asked=10.0), results).text == "10.00"


def test_numbers_of_a_cell() -> None:
    assert numbers_in("29 555, 459") == [29555.0, 459.0]
    assert numbers_in("1.14 (1.08 to 1.23)") == [1.14, 1.08, 1.23]
    assert numbers_in("1 / ∞ / ∞") == [1.0, math.inf, math.inf]
    assert numbers_in("–") == []


def test_a_panel_shows_spreads_pairs_and_single_figures() -> None:
    rows = (("a", "1 / 2 / 3"), ("b", "1 / 2"), ("c", "17.4 ± 0.3"))
    results = result_of(replace(made(OLD), tables=(Table("", ("name", "mm"), rows),)))
    place = Place(result="test", column="mm")
    panel = Panel(title="t", label="mm", place=place, by="name", names={"a": "A", "b": "B", "c": "C"}, asked=2.0)
    claim = claims.Claim(name="n", title="t", text="", pages=[], panels=[panel])
    lines = claims.plot(claim, results).panels[0].lines
    assert [(line.name, line.median, line.p90, line.largest) for line in lines if isinstance(line, Range)] == [
        ("A", 1.0, 2.0, 3.0),
        ("B", 1.0, 2.0, 2.0),
        ("C", 17.4, 17.4, 17.4),
    ]
    json.dumps(claims.plot(claim, results).as_json(), allow_nan=False)
