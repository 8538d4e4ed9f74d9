"""A wizard's connection to its page: sends text and questions, receives answers."""

from __future__ import annotations

import json
import signal
import threading
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tactile_lab.view.page_transport import PageTransport
from tactile_lab.view.scene import WIZARD_TOPIC

QUIT = "q"
"""The answer that ends every wizard."""
_LINES, _TABLES = 8, 8


class WizardFeed(PageTransport):
    """A page that shows a wizard: its question with a button for each answer, its figures, and the hand.

    Every message contains the complete state of the page, so that a lost one does not matter.

    Args:
        address, port, token, title, certificate: see :class:`~tactile_lab.view.page_transport.PageTransport`.
    """

    def __init__(self, address: str, port: int, token: str, title: str, *, certificate: str = "") -> None:
        super().__init__("wizard", address, port, token, title, certificate=certificate)
        self._lines: deque[tuple[str, str]] = deque(maxlen=_LINES)
        self._tables: dict[str, dict[str, Any]] = {}
        self._number, self._text, self._usual = 0, "", ""
        self._answers: dict[str, str] = {}
        self._pressed: deque[str] = deque()

    # --- out ---------------------------------------------------------------------------------------------------

    def line(self, text: str, style: str = "") -> None:
        """Show one line of text."""
        self._lines.append((text, style))
        self.renew()

    def table(self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]) -> None:
        """Show a table; it replaces an older one with the same title."""
        self._tables.pop(title, None)
        self._tables[title] = {"title": title, "columns": list(columns), "rows": [*rows], "right": list(right)}
        for old in list(self._tables)[:-_TABLES]:
            del self._tables[old]
        self.renew()

    def ask(self, text: str, answers: Mapping[str, str], usual: str) -> None:
        """Show a question with its possible answers by key; answers to earlier questions are ignored."""
        self._answers = {}
        self._pressed.clear()
        self._number += 1
        self._text, self._usual, self._answers = text, usual, dict(answers)
        self.renew()

    def on_answered(self) -> None:
        """The question is answered: remove its buttons."""
        self._answers = {}
        self.renew()

    def renew(self) -> None:
        """Show all of it again."""
        answers = [[key, meaning] for key, meaning in self._answers.items() if key != QUIT]
        question = {"number": self._number, "text": self._text, "answers": answers, "usual": self._usual}
        content = {"question": question, "lines": list(self._lines), "tables": list(self._tables.values())}
        self.write(WIZARD_TOPIC, json.dumps(content).encode(), 0)

    # --- in ----------------------------------------------------------------------------------------------------

    def on_press(self, content: Mapping[str, Any]) -> None:
        """Store an answer to the current question; to quit without a question is like Ctrl+C.

        Raises:
            TypeError: it is not an answer.
        """
        key, number = content.get("answer"), content.get("question")
        if key == QUIT and not self._answers:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        elif key in self._answers and (key == QUIT or number == self._number):
            self._pressed.append(str(key))

    def answer(self) -> str | None:
        """The pressed answer, if any."""
        return self._pressed.popleft() if self._pressed else None
