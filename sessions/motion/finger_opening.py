"""Which fingers of a hand that opens move next, and which wait for others.

Overloaded fingers open first, unless another is in their way. One that falls behind its target waits until it has
followed: where joints are unlike late, its tip dips. One that is resisted opens last.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field


@dataclass
class FingerOpening:
    """How far each finger has opened.

    Attributes:
        closed, opened: progress of each finger along its path, at first and in the end.
        step: share of the way that a finger opens in a cycle.
        patience: cycles in which a finger that nothing holds has followed its target.
        shares: of the way, by finger.
        late: the fingers that are behind their targets.
    """

    closed: Mapping[str, float]
    opened: Mapping[str, float]
    step: float
    patience: int
    shares: dict[str, float] = field(init=False)
    late: frozenset[str] = field(init=False, default=frozenset())

    def __post_init__(self) -> None:
        self.shares, self._behind = dict.fromkeys(self.closed, 0.0), dict.fromkeys(self.closed, 0)

    @property
    def still_closed(self) -> set[str]:
        """The fingers that have not opened all the way."""
        return {finger for finger, share in self.shares.items() if share < 1.0}

    @property
    def progress(self) -> dict[str, float]:
        """Of each finger along its path."""
        return {finger: self._at(finger, share) for finger, share in self.shares.items()}

    @property
    def waiting(self) -> set[str]:
        """The late fingers that may follow yet."""
        return {finger for finger in self.late if self._behind[finger] <= self.patience}

    @property
    def held_back(self) -> set[str]:
        """The late fingers that something holds."""
        return set(self.late) - self.waiting

    def on_late(self, late: Iterable[str]) -> None:
        """These fingers are behind their targets in this cycle."""
        self.late = frozenset(late)
        self._behind = {finger: count + 1 if finger in self.late else 0 for finger, count in self._behind.items()}

    def next_place(self, finger: str) -> float:
        """Progress of a finger after its next step."""
        return self._at(finger, self.shares[finger] + self.step)

    def open_next(self, free: set[str], overloaded: set[str], resisted: set[str]) -> None:
        """Open those whose turn it is by a step.

        Args:
            free: of the fingers that are still closed, those that no other is in the way of.
            overloaded: fingertips that are pressed hard, or held up.
            resisted: fingers that are over the object or in its way.
        """
        urgent, able = overloaded - resisted - self.late, free - self.waiting
        for finger in urgent & free or able - resisted or able or self.still_closed - self.waiting:
            self.shares[finger] = min(1.0, self.shares[finger] + self.step)

    def _at(self, finger: str, share: float) -> float:
        return self.closed[finger] + min(1.0, share) * (self.opened[finger] - self.closed[finger])
