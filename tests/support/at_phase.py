"""Something that happens when a session comes to a phase."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from sessions.conductor.progress import NullProgress


@dataclass
class At(NullProgress):
    """Does something once, when a phase first begins."""

    phase_name: str = ""
    act: Callable[[], None] = lambda: None
    told_of: list[str] = field(default_factory=list)

    def phase(self, number: int, name: str) -> None:
        if name == self.phase_name and name not in self.told_of:
            self.act()
        self.told_of.append(name)
