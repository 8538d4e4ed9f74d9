"""The panel of a wizard's page: the question with its answers as buttons, the tables so far, and the latest text."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import viser
from viser import Icon

from tactile_lab.view.controls import GREEN, GREY, PANEL_STYLE, RED, banner, forces_html, line_html
from tactile_lab.view.scene import Scene

Answer = Callable[[int, str], None]
"""Called with a question's number and the key of the answer."""

_VERDICTS = {"PASS": "#2ea043", "FAIL": "#cf222e"}
_COLOURS = {"red": "#cf222e", "yellow": "#9a6700", "green": "#1a7f37", "dim": "#57606a"}
_HEAD, _BUTTONS, _QUIT, _TOLD = 0.0, 1.0, 50.0, 100.0


class WizardPanel:
    """Draws the panel.

    Args:
        server: the page.
        answer: called with a pressed answer.
        quit_key: the answer of the button that is always shown.
    """

    def __init__(self, server: viser.ViserServer, answer: Answer, quit_key: str) -> None:
        self._server, self._answer = server, answer
        self._head = server.gui.add_html("", order=_HEAD)
        hint = "Quit; nothing is stored"
        leave = server.gui.add_button("Quit", hint=hint, icon=Icon.PLAYER_STOP, color=RED, order=_QUIT)
        leave.on_click(lambda event: answer(0, quit_key))
        self._told = server.gui.add_html("", order=_TOLD)
        self._shown: tuple[int, int] = (0, 0)
        self._buttons: list[Any] = []

    def draw(self, scene: Scene) -> None:
        """Update the panel."""
        self._head.content, self._told.content = head_html(scene), told_html(scene)
        question = scene.wizard.get("question", {"number": 0, "answers": []})
        shown = (int(question["number"]), len(question["answers"]))
        if shown != self._shown:
            self._shown = shown
            self._show_answers(question)

    def _show_answers(self, question: dict[str, Any]) -> None:
        for button in self._buttons:
            button.remove()
        self._buttons = [self._button(question, place) for place in range(len(question["answers"]))]

    def _button(self, question: dict[str, Any], place: int) -> Any:
        key, meaning = question["answers"][place]
        colour = GREEN if key == question["usual"] else GREY
        button = self._server.gui.add_button(meaning.capitalize(), color=colour, order=_BUTTONS + place)
        button.on_click(lambda event: self._answer(int(question["number"]), key))
        return button


def head_html(scene: Scene) -> str:
    """The question, or the current activity, and the forces on the fingertips."""
    question = scene.wizard.get("question", {})
    style = "font-size:1.15em;font-weight:600;color:#1f6feb"
    text = line_html(str(question.get("text", "")), style)
    waits = "" if not question or question["answers"] else line_html("Working: wait, or quit", "color:#57606a")
    forces = forces_html(scene) if scene.loads_N else ""
    return f'<div style="{PANEL_STYLE}">{text}{waits}{forces}</div>'


def told_html(scene: Scene) -> str:
    """The latest text below the verdict, and the tables, newest first."""
    lines = scene.wizard.get("lines", [])
    verdicts = [banner(text, _VERDICTS[text]) for text, _ in lines if text in _VERDICTS]
    words = [line_html(text, f"color:{_colour(style)}") for text, style in reversed(lines) if text not in _VERDICTS]
    tables = [_table(table) for table in reversed(scene.wizard.get("tables", []))]
    return f'<div style="{PANEL_STYLE}">{"".join(verdicts[-1:] + words + tables)}</div>'


def _colour(style: str) -> str:
    return next((_COLOURS[word] for word in reversed(style.split()) if word in _COLOURS), "#24292f")


def _table(table: dict[str, Any]) -> str:
    """A scrollable table, since there may be many poses."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in table["columns"])
    rows = "".join(f"<tr>{_cells(row, table['right'])}</tr>" for row in table["rows"])
    title = line_html(table["title"], "font-weight:600;margin-top:0.6em")
    content = f'<table style="width:100%;text-align:left"><tr style="color:#57606a">{head}</tr>{rows}</table>'
    return f'{title}<div style="max-height:24em;overflow-y:auto">{content}</div>'


def _cells(row: list[str], right: list[int]) -> str:
    sides = ("right" if place in right else "left" for place in range(len(row)))
    cells = (
        f'<td style="text-align:{side};padding-right:0.6em;vertical-align:top">{html.escape(cell)}</td>'
        for side, cell in zip(sides, row, strict=True)
    )
    return "".join(cells)
