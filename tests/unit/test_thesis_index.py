"""The index of the thesis leads to the code: what it names exists, and is cited where it says."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from tests.support.thesis_index import (
    PAGE,
    REPOSITORY,
    Citation,
    Row,
    best_line,
    citations,
    cited_in,
    expand,
    refreshed,
    rows,
)

SCREEN = 20
"""A link may be off by so many lines: what it leads to is still on the screen."""


@cache
def cited() -> list[Citation]:
    return list(citations())


@cache
def index() -> list[Row]:
    return list(rows(PAGE.read_text(encoding="utf-8")))


LINKS = [pytest.param(row, *link, id=f"{row.items[0]}-{Path(link[0]).name}") for row in index() for link in row.links]


@pytest.mark.parametrize(("row", "path", "line"), LINKS)
def test_a_link_leads_to_where_the_code_cites_it(row: Row, path: str, line: int) -> None:
    assert (REPOSITORY / path).is_file()
    best = best_line(row, path, cited())
    assert best is not None, f"{path} does not cite {row.items}"
    assert abs(best - line) <= SCREEN, "out of date: python -m tests.support.thesis_index"


def test_everything_that_the_code_cites_is_in_the_index() -> None:
    listed = {item for row in index() for item in row.items}
    wanted = {each.item for each in cited()}
    assert len(wanted) > 90  # else the patterns find nothing any more
    assert wanted - listed == set()


def test_equation_3_9_is_linked_at_its_line() -> None:
    (row,) = (row for row in index() if "equation 3.9" in row.items)
    ((path, _),) = row.links
    line = best_line(row, path, cited())
    assert line is not None
    assert "np.abs" in (REPOSITORY / path).read_text(encoding="utf-8").splitlines()[line - 1]


def test_three_clicks_lead_from_the_readme_to_the_index() -> None:
    assert "](docs/thesis.md)" in (REPOSITORY / "README.md").read_text(encoding="utf-8")


# --- the patterns --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "single"),
    [
        ("3.9", ["3.9"]),
        ("3.7 and 3.8", ["3.7", "3.8"]),
        ("3.19 to 3.22", ["3.19", "3.20", "3.21", "3.22"]),
        ("3.10-3.12", ["3.10", "3.11", "3.12"]),
        ("2.13, 2.18", ["2.13", "2.18"]),
        ("A", ["A"]),
    ],
)
def test_lists_of_numbers_are_taken_apart(numbers: str, single: list[str]) -> None:
    assert expand(numbers) == single


def test_citations_are_told_from_numbers_that_are_none() -> None:
    text = '''"""Motion (thesis eq. 3.7 and 3.8), behind algorithm 3.1 (section 3.5.1, appendix A)."""
rate = np.deg2rad(5.0) + wait(2.0) + (2.75)
width = 3  # (3.9)
'''
    found = {(each.item, each.line, each.weight) for each in cited_in(text, "a.py")}
    assert found == {
        ("equation 3.7", 1, 1),
        ("equation 3.8", 1, 1),
        ("algorithm 3.1", 1, 1),
        ("section 3.5.1", 1, 1),
        ("appendix A", 1, 1),
        ("equation 3.9", 3, 2),
    }


def test_refreshing_moves_links_to_the_statement_and_changes_nothing_else() -> None:
    page = "Words.\n\n| Equation | In |\n|---|---|\n| 3.9 | [b.py](../a/b.py#L1), [c.py](../a/c.py) |\n"
    places = [Citation("equation 3.9", "a/b.py", 5, 0), Citation("equation 3.9", "a/b.py", 9, 2)]
    assert refreshed(page, places) == page.replace("#L1", "#L9")
    assert re.search(r"L9\), \[c.py\]\(../a/c.py\)", refreshed(page, places))
