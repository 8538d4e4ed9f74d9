"""The mechanisms of method "joint" by name, so that each can be switched off to measure its benefit.

docs/estimator.md explains them; experiment "ablation" measures them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias, TypeVar

Mechanism: TypeAlias = Literal[
    "splicing",
    "relocation",
    "pushes",
    "surprises",
    "valleys",
    "free space",
    "deferred association",
    "faces",
    "doubts",
    "without one",
    "placing on the object",
    "regular faces",
    "finger errors",
    "pose uncertainty",
]
"""Backward reading, the beam and the fixed lag have settings of their own, shape models theirs."""

_Value = TypeVar("_Value")


class Mechanisms:
    """Which mechanisms are on, and which of those changed anything.

    Attributes:
        changed: names of mechanisms that changed a hypothesis.
    """

    def __init__(self, without: frozenset[Mechanism] = frozenset()) -> None:
        """
        Args:
            without: those that are left out.
        """
        self._without = without
        self.changed: set[Mechanism] = set()

    def has(self, name: Mechanism) -> bool:
        """Whether a mechanism is on."""
        return name not in self._without

    def improve(self, name: Mechanism, given: _Value, improved: Callable[[_Value], _Value]) -> _Value:
        """The result of a mechanism; the unchanged input if it is off."""
        found = improved(given) if self.has(name) else given
        if found is not given:
            self.changed.add(name)
        return found

    def add(self, name: Mechanism, further: Callable[[], list[_Value]]) -> list[_Value]:
        """Additional proposals of a mechanism; none if it is off."""
        found = further() if self.has(name) else []
        if found:
            self.changed.add(name)
        return found
