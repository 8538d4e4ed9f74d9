"""Problems that devices report during a session: logged when they begin, and with their final counts at the end.

A driver counts a fault and continues, or stops. The counted faults are recorded here, so that a session with dropped
messages can be distinguished from one without.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

_FIGURE = re.compile(r"\b\d[\d.]*\b")
_AT_REST = ("not tared", "no sample received yet", "no reading received yet", "halted, no demand for 20 ms")
"""Endings of messages that are not faults: fingertips not used yet, and motors without demands."""


class HealthWatch:
    """Compares the problems of devices with earlier ones.

    Args:
        tell: receives each problem once, by device and words, however its counts grow.

    Attributes:
        listener: receives the same, for the operator.
    """

    def __init__(self, tell: Callable[[str, str], None]) -> None:
        self._tell = tell
        self._newest: dict[str, str] = {}
        self.listener: Callable[[str], None] = lambda words: None

    def look(self, problems: Iterable[str]) -> None:
        """Note the present problems, each beginning with the device's name."""
        for words in problems:
            if words.endswith(_AT_REST):
                continue
            kind = _FIGURE.sub("", words)
            if kind not in self._newest:
                self._tell(*_device_and_words(words))
                self.listener(words)
            self._newest[kind] = words

    def conclude(self, problems: Iterable[str]) -> None:
        """Report all problems once more, with their final counts, and start again."""
        self.look(problems)
        found, self._newest = self._newest, {}
        for words in found.values():
            device, text = _device_and_words(words)
            self._tell(device, f"total: {text}")


def _device_and_words(words: str) -> tuple[str, str]:
    device, _, text = words.partition(": ")
    return device, text
