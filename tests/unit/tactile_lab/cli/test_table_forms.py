"""Tables for people lose nothing, however narrow the terminal is, and are as wide as they need in a pipe."""

from __future__ import annotations

import io
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console

from tactile_lab.cli import console
from tactile_lab.evaluation.sweep import summary_titles

TITLES = summary_titles()
SPREADS = [f"{number}.25 / 45.67 / 189.1{number}" for number in range(len(TITLES) - 5)]
REASON = "3: the object cannot be followed any further; 5: lost [red]"
ROWS = [["elliptic-cylinder", "2", "10", *SPREADS, "2", REASON], ["box-10x6x4", "3", "9", *SPREADS, "0", ""]]


@pytest.fixture
def shown(monkeypatch):
    """What people see of a table, on a terminal of some width or in a pipe."""

    def show(width, columns, rows, *, terminal=True, title="Errors", right=()):
        return shown_by(monkeypatch.setattr, width, columns, rows, terminal, title, right)

    return show


def shown_by(patch, width, columns, rows, terminal, title, right):
    people = Console(file=io.StringIO(), width=width, force_terminal=terminal, color_system=None, highlight=False)
    patch(console, "_answers", people)
    patch(console, "_json_only", False)
    console.show_table(title, columns, rows, right=right)
    return [line.rstrip() for line in people.file.getvalue().splitlines()]


def test_a_table_that_is_too_wide_for_the_terminal_is_shown_row_by_row(shown):
    lines = shown(80, TITLES, ROWS)
    assert max(map(len, lines)) <= 80
    assert lines[:2] == ["Errors", ""]
    first, second = lines.index("elliptic-cylinder"), lines.index("box-10x6x4")
    names = [line.partition(":")[0] for line in lines[first + 1 : second]]
    assert [name.strip() for name in names if name.strip()][: len(TITLES) - 1] == TITLES[1:]
    assert any(line.split(":")[0] == "  Hausdorff, mm" and line.endswith("  " + SPREADS[0]) for line in lines)
    assert not any("seeds and reasons" in line for line in lines[second:])  # nothing to tell


@pytest.mark.parametrize("width", [280, 360])
def test_a_table_that_fits_the_terminal_is_one(shown, width):
    lines = shown(width, TITLES, ROWS)
    (head,) = [line for line in lines if "Hausdorff, mm" in line]
    assert all(title in head for title in TITLES)
    (row,) = [line for line in lines if "box-10x6x4" in line]
    assert all(spread in row for spread in SPREADS)


@pytest.mark.parametrize("width", [80, 200])
def test_whether_a_table_fits_is_asked_of_its_content_and_not_of_its_kind(shown, width):
    assert "elliptic-cylinder" in shown(width, TITLES, ROWS)
    names = ["session", "status", "grasps", "MB", "object"]
    row = ["20261121-093000-sim-box", "closed, piece", "16", "0.1", "box-10x6x4"]
    lines = shown(width, names, [row], right=(2, 3))
    assert [line.split() for line in lines if "20261121" in line] == [" ".join(row).split()]


def test_a_pipe_gets_one_line_a_row_however_wide(shown):
    lines = shown(80, TITLES, ROWS, terminal=False)
    (row,) = [line for line in lines if "elliptic-cylinder" in line]
    assert all(spread in row for spread in SPREADS)
    assert row.endswith(REASON)


@pytest.mark.parametrize("terminal", [True, False])
def test_a_table_shows_characters_that_command_terminals_and_obeys_none(shown, terminal):
    lines = shown(80, ["session", "notes"], [["a", "\x1b[2Jgone\rand \u202eback"]], terminal=terminal, title="\aT")
    (row,) = [line for line in lines if "gone" in line]
    assert row.split() == ["a", r"\x1b[2Jgone\rand", r"\u202eback"]
    assert lines[0] == r"\x07T"


def test_a_table_without_rows_shows_its_head(shown):
    assert any("session" in line for line in shown(80, ["session", "status"], []))


def test_a_long_path_in_the_last_column_is_broken_and_not_cut(shown):
    path = "/runs/" + "0123456789" * 12
    lines = shown(80, ["device", "detail"], [["hand", path]])
    assert path in "".join("".join(lines).split())


def test_a_long_path_among_facts_is_broken_and_not_cut(monkeypatch):
    people = Console(file=io.StringIO(), width=40, force_terminal=True, color_system=None)
    monkeypatch.setattr(console, "_answers", people)
    monkeypatch.setattr(console, "_json_only", False)
    path = "/runs/" + "0123456789" * 12
    console.show_facts("session", [("folder", path), ("notes", "")])
    assert path in "".join(people.file.getvalue().split())
    assert "notes" not in people.file.getvalue()


words = st.text("ab 漢[/]:…\n", max_size=30)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    width=st.integers(20, 200),
    terminal=st.booleans(),
    title=words,
    table=st.integers(1, 5).flatmap(
        lambda n: st.lists(st.lists(words, min_size=n, max_size=n), min_size=1, max_size=3)
    ),
)
def test_a_table_fits_its_terminal_and_no_character_is_lost(width, terminal, title, table):
    head, *rows = table
    with pytest.MonkeyPatch.context() as patched:
        lines = shown_by(patched.setattr, width, head, rows, terminal, title, ())
    told = Counter("".join(lines))
    expected = Counter("".join("".join(row) for row in rows) + title)
    assert not {character: count for character, count in (expected - told).items() if not character.isspace()}
    assert not terminal or max(map(cell_len, lines)) <= width


@pytest.mark.parametrize("terminal", [True, False])
def test_long_facts_are_broken_on_a_terminal_alone(monkeypatch, terminal):
    people = Console(file=io.StringIO(), width=40, force_terminal=terminal, color_system=None, highlight=False)
    monkeypatch.setattr(console, "_answers", people)
    monkeypatch.setattr(console, "_json_only", False)
    console.show_facts("Session", [("ending", "failed: ../sessions/x: the disk is full"), ("note", "two\nlines")])
    text = people.file.getvalue()
    assert ("failed: ../sessions/x: the disk is full" in text) is not terminal
    assert "full" in text
    assert "lines" in text
    console.show_facts("Nothing", [])
