"""A wizard's end of its page: what it tells and asks goes out, answers come in."""

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

    Every message holds all that the page shows, so that one that is lost is made good by the next.

    Args:
        address, port, token, title: see :class:`~tactile_lab.view.page_transport.PageTransport`.
    """

    def __init__(self, address: str, port: int, token: str, title: str) -> None:
        super().__init__("wizard", address, port, token, title)
        self._lines: deque[tuple[str, str]] = deque(maxlen=_LINES)
        self._tables: dict[str, dict[str, Any]] = {}
        self._number, self._text, self._usual = 0, "", ""
        self._answers: dict[str, str] = {}
        self._pressed: deque[str] = deque()

    # --- out ---------------------------------------------------------------------------------------------------

    def line(self, text: str, style: str = "") -> None:
        """One line that people are told."""
        self._lines.append((text, style))
        self.renew()

    def table(self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]) -> None:
        """A table; it takes the place of an older one of that title."""
        self._tables.pop(title, None)
        self._tables[title] = {"title": title, "columns": list(columns), "rows": [*rows], "right": list(right)}
        for old in list(self._tables)[:-_TABLES]:
            del self._tables[old]
        self.renew()

    def ask(self, text: str, answers: Mapping[str, str], usual: str) -> None:
        """Show a question with what may be answered to it, by key; answers to earlier ones count no longer."""
        self._answers = {}
        self._pressed.clear()
        self._number += 1
        self._text, self._usual, self._answers = text, usual, dict(answers)
        self.renew()

    def on_answered(self) -> None:
        """The question is answered, and its buttons go."""
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
        """Keep an answer to the question that is shown; to quit is like Ctrl+C while there is none.

        Raises:
            TypeError: it is no answer.
        """
        key, number = content.get("answer"), content.get("question")
        if key == QUIT and not self._answers:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        elif key in self._answers and (key == QUIT or number == self._number):
            self._pressed.append(str(key))

    def answer(self) -> str | None:
        """What was pressed, if anything was."""
        return self._pressed.popleft() if self._pressed else None
