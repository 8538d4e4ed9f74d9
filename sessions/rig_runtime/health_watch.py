"""What devices say to be wrong while a session goes on: told when it begins, and with its newest figures at the end.

A driver counts a fault and goes on, or stops. That it counted is recorded here, so that a session in which a wire
dropped messages can be told from one in which none did.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

_FIGURE = re.compile(r"\b\d[\d.]*\b")
_AT_REST = ("not tared", "no sample received yet", "no reading received yet", "halted, no demand for 20 ms")
"""Ends of what fingertips say before they are used, and motors that are told nothing; no faults."""


class HealthWatch:
    """Compares what devices say to be wrong with what they said before.

    Args:
        tell: is told each fault once, by device and words, however its figures grow.

    Attributes:
        listener: is told the same; a person.
    """

    def __init__(self, tell: Callable[[str, str], None]) -> None:
        self._tell = tell
        self._newest: dict[str, str] = {}
        self.listener: Callable[[str], None] = lambda words: None

    def look(self, problems: Iterable[str]) -> None:
        """Take note of what is wrong now, each beginning with the device's name."""
        for words in problems:
            if words.endswith(_AT_REST):
                continue
            kind = _FIGURE.sub("", words)
            if kind not in self._newest:
                self._tell(*_device_and_words(words))
                self.listener(words)
            self._newest[kind] = words

    def conclude(self, problems: Iterable[str]) -> None:
        """Tell everything that is or was wrong once more, with its newest figures, and begin anew."""
        self.look(problems)
        found, self._newest = self._newest, {}
        for words in found.values():
            device, text = _device_and_words(words)
            self._tell(device, f"in all: {text}")


def _device_and_words(words: str) -> tuple[str, str]:
    device, _, text = words.partition(": ")
    return device, text
