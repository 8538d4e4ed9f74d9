"""The person at the terminal of a guided session."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from types import TracebackType
from typing import Self

from rich.console import RenderableType
from rich.live import Live
from rich.text import Text

from sessions.guided.operator import Ask, Panel, Request, Stage
from tactile_lab.cli.console import people, say
from tactile_lab.cli.running.guided_keys import BY_KEY, ENTER, ESCAPE, Binding, pedal_key, request_of_line, split_keys
from tactile_lab.cli.running.guided_screen import as_lines, as_panel
from tactile_lab.cli.terminal_input import KeyInput, LineInput

_LEAVE = Request(Ask.END, text="the terminal was closed")
_BACKSPACES = ("\x7f", "\x08")


class KeyTerminal:
    """Single keys, and a panel that is updated in place.

    A separate thread draws the panel, so that a slow terminal does not delay the session.

    Args:
        pedal: an additional key that captures, see :func:`pedal_key`; "" for none.

    Raises:
        ConfigurationError: the pedal's key is unknown.
    """

    attended = True

    def __init__(self, pedal: str = "") -> None:
        self._pedal = pedal_key(pedal)
        self._input = KeyInput()
        self._panel: Panel | None = None
        self._typing: tuple[Binding, str] | None = None
        self._told_closed = False
        self._contexts = ExitStack()

    def __enter__(self) -> Self:
        self._contexts.enter_context(self._input)
        live = Live(console=people, refresh_per_second=6, transient=True, get_renderable=self._render)
        self._contexts.enter_context(live)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._contexts.close()

    def requests(self) -> Sequence[Request]:
        requests = [request for key in split_keys(self._input.read()) if (request := self._on_key(key))]
        if self._input.closed and not self._told_closed:
            self._told_closed = True
            requests.append(_LEAVE)
        return requests

    def show(self, panel: Panel) -> None:
        self._panel = panel

    def _render(self) -> RenderableType:
        panel, typing = self._panel, self._typing
        if panel is None:
            return Text("starting", style="dim")
        return as_panel(panel, f"{typing[0].word}: {typing[1]}" if typing else "")

    def _on_key(self, key: str) -> Request | None:
        if self._typing is not None:
            return self._on_text_key(*self._typing, key)
        if self._pedal and key == self._pedal:
            return Request(Ask.NEXT)
        binding = BY_KEY.get(key) or BY_KEY.get(key.lower())
        if binding is None:
            return None
        if binding.wants_text:
            self._typing = (binding, "")
            return None
        return binding.request

    def _on_text_key(self, binding: Binding, text: str, key: str) -> Request | None:
        """One key of a text: ENTER ends the text, ESC cancels it."""
        if key in (ENTER, ESCAPE):
            self._typing = None
            return replace(binding.request, text=text) if key == ENTER and text.strip() else None
        text = text[:-1] if key in _BACKSPACES else text + (key if len(key) == 1 and key.isprintable() else "")
        self._typing = (binding, text)
        return None


class LineTerminal:
    """Whole lines, for simple terminals and pipes: prints changes and reads words."""

    attended = True

    def __init__(self) -> None:
        self._input = LineInput()
        self._said: tuple[int, Stage, str] | None = None
        self._message = ""
        self._waiting: deque[str] = deque()
        self._shown = False
        self._told_closed = False

    def __enter__(self) -> Self:
        say(
            "Type a word and ENTER: next, go, undo, give-up, pause, end, note TEXT; full list in "
            "docs/guided-sessions.md"
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing to restore."""

    def requests(self) -> Sequence[Request]:
        """Read one line at a time: the next one after a panel was shown."""
        self._waiting.extend(self._input.lines())
        if self._waiting and self._shown:
            self._shown = False
            return self._parse_line(self._waiting.popleft())
        if self._waiting:
            return []
        if self._input.closed and not self._told_closed:
            self._told_closed = True
            return [_LEAVE]
        return []

    def show(self, panel: Panel) -> None:
        self._shown = True
        now = (panel.grasp, panel.stage, panel.prompt)
        if now != self._said:
            self._said = now
            for line in as_lines(panel):
                say(line)
        if panel.message != self._message:
            self._message = panel.message
            say(f"  {panel.message}")

    def _parse_line(self, line: str) -> list[Request]:
        request = request_of_line(line)
        if request is None:
            say(f"  not understood: {line.strip()[:60]}", "yellow")
            return []
        return [replace(request, text=request.text or "typed")] if request.ask is Ask.END else [request]


def terminal_for(pedal: str = "") -> KeyTerminal | LineTerminal:
    """The display that standard input and output allow. Raises ConfigurationError as :class:`KeyTerminal` does."""
    pedal_key(pedal)  # a key that there is not is told on any input
    able = sys.stdin.isatty() and people.is_terminal and not people.is_dumb_terminal
    return KeyTerminal(pedal) if able else LineTerminal()
