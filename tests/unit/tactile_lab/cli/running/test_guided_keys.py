"""Keys and words of a guided session, and terminals that are put back as they were."""

from __future__ import annotations

import os
import pty
import termios
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from sessions.guided.operator import Ask, Panel, Request, Stage
from sessions.guided.operator_view import OperatorView
from tactile_lab.cli.running.guided_keys import BINDINGS, BY_KEY, pedal_key, request_of_line, split_keys
from tactile_lab.cli.running.guided_screen import as_lines, as_panel, facts
from tactile_lab.cli.running.guided_terminal import KeyTerminal
from tactile_lab.cli.terminal_input import KeyInput, LineInput
from tests.support.repository import REPOSITORY

GUIDE = REPOSITORY / "docs" / "guided-sessions.md"


def test_every_key_and_every_word_means_one_thing() -> None:
    assert len({binding.key for binding in BINDINGS}) == len({binding.word for binding in BINDINGS}) == len(BINDINGS)


@pytest.mark.parametrize("key", ["a", "u", "x", "p", "n", "m", "i", "t", "e"])
def test_the_guide_tells_the_keys(key: str) -> None:
    assert key in BY_KEY
    assert f"| `{key}`" in GUIDE.read_text()


def test_keys_are_told_apart_in_what_a_terminal_sends() -> None:
    sent = "g \x1b[A\x1bOD\x1b[6~\r\x1b[15~u\x1b[99~\x1b"
    assert split_keys(sent) == ["g", " ", "up", "left", "page down", "enter", "f5", "u", "escape"]


@pytest.mark.parametrize("text", ["\x1b[", "\x1bO", "\x1b[1;2;3", "\x00\x07", "\x1b\x1b[A"])
def test_torn_and_strange_sequences_do_no_harm(text: str) -> None:
    assert all(key not in ("g", "u", "e", " ") for key in split_keys(text))


@pytest.mark.parametrize(
    ("line", "request_"),
    [
        ("next", Request(Ask.NEXT)),
        ("", Request(Ask.NEXT)),
        ("u", Request(Ask.UNDO)),
        ("note  it slipped ", Request(Ask.NOTE, text="it slipped")),
        ("far 3", Request(Ask.MOVE, x=3)),
        ("turn-right 2", Request(Ask.MOVE, turn=-2)),
        ("close 2", Request(Ask.FINGERS, fingers=FINGERS, steps=2)),
        ("open-th", Request(Ask.FINGERS, fingers=("TH",), steps=-1)),
        ("far 99", None),
        ("far -1", None),
        ("fly", None),
    ],
)
def test_lines_say_the_same_as_keys(line: str, request_: Request | None) -> None:
    assert request_of_line(line) == request_


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    ours, theirs = pty.openpty()
    yield ours, theirs
    os.close(theirs)
    os.close(ours)


def _use_and_interrupt(ours: int, theirs: int) -> None:
    before = termios.tcgetattr(theirs)
    with KeyInput(theirs) as keys:
        assert termios.tcgetattr(theirs) != before
        assert keys.read() == ""
        os.write(ours, b"g\x1b[A")
        assert split_keys(keys.read()) == ["g", "up"]
        raise KeyboardInterrupt


PEDALS = [("f5", b"\x1b[15~"), ("b", b"b"), ("Page-Up", b"\x1b[5~"), ("tab", b"\t")]


@pytest.mark.parametrize(("pedal", "sends"), PEDALS)
def test_pedal_may_send_any_key(pedal: str, sends: bytes, terminal: tuple[int, int], monkeypatch: Any) -> None:
    ours, theirs = terminal
    with open(theirs, closefd=False) as keyboard:
        monkeypatch.setattr("sys.stdin", keyboard)
        keys = KeyTerminal(pedal)
        with keys._input:  # without the panel and its thread
            os.write(ours, b"q" + sends + b"\x1b[6~")
            assert keys.requests() == [Request(Ask.NEXT), Request(Ask.NEXT)]


def test_pedal_that_no_key_is_called_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ConfigurationError, match="unknown key 'pedal-1'") as refused:
        pedal_key("pedal-1")
    assert "f12" in refused.value.hint


def test_terminal_is_put_back_whatever_happens(terminal: tuple[int, int]) -> None:
    ours, theirs = terminal
    before = termios.tcgetattr(theirs)
    with pytest.raises(KeyboardInterrupt):
        _use_and_interrupt(ours, theirs)
    assert termios.tcgetattr(theirs) == before


def test_lines_come_when_they_are_complete_and_the_end_is_noticed() -> None:
    reading, writing = os.pipe()
    lines = LineInput(reading)
    assert lines.lines() == []
    os.write(writing, b"next\nno")
    assert lines.lines() == ["next"]
    os.write(writing, b"te x\n")
    assert lines.lines() == ["note x"]
    os.close(writing)
    assert lines.lines() == []
    assert lines.closed
    os.close(reading)


def test_panel_says_prompt_contacts_and_what_is_silent() -> None:
    view = OperatorView({"FF": 0.4, "MF": None}, ("FF",), 0.2, False, 0.31, ("MF",))
    panel = Panel(0, 2, Stage.HOLD, "Hold still", view, capture="2 more fingers must touch", paused="coffee")
    told = dict(facts(panel))
    assert told["contacts"] == "1 fingers touch: FF 0.40 N"
    assert told["silent"] == "MF"
    assert told["stability"] == "2 more fingers must touch"
    assert told["observability"].startswith("0.31")
    assert as_lines(panel)[0] == "[2 hold] Hold still"
    assert "  stability: 2 more fingers must touch" in as_lines(panel)
    beginning = replace(panel, stage=Stage.PLACE, unknown="40 % of the surface is known", suggestion="pinch")
    assert as_lines(beginning)[2:] == ["  object: 40 % of the surface is known", "  suggested: pinch"]
    assert as_panel(panel) is not None
    assert panel.content()["stage"] == "hold"
