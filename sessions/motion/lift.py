"""How a lift ended that weighs an object, and whether the object is too heavy for the fingers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

FIRMER = 1.25
"""Held by a force only so much larger, an object would slip out again instead of being lifted."""


class LiftEnd(StrEnum):
    """How a lift ended, in words."""

    HUNG = "it was lifted and set down again"
    HELD = "it was lifted, but stood on an edge, or links of the fingers carried a part of it"
    HEAVY = "it is too heavy: the upward force reached its limit"
    LOST = "it slipped out of the fingers"
    PRESSED = "a fingertip was pressed hard"
    ABOVE = "it was lifted, but a fingertip came down on it when it was set down"

    @property
    def is_held(self) -> bool:
        """Whether the fingers still hold the object where they grasped it."""
        return self not in (LiftEnd.LOST, LiftEnd.ABOVE)


@dataclass(frozen=True)
class Lift:
    """How an object was lifted.

    Attributes:
        end: how that ended.
        carried_N: largest upward force of the fingertips on it.
        squeezed_N, allowed_N: force of each finger beside the thumb, in the last lift and at most.
    """

    end: LiftEnd
    carried_N: float
    squeezed_N: float
    allowed_N: float

    @property
    def needed_N(self) -> float:
        """Force of each finger with which another lift would be worth a try."""
        return FIRMER * self.squeezed_N

    @property
    def is_too_heavy(self) -> bool:
        """Whether it slipped, and the fingers may not press so much harder that another lift is worth a try."""
        return self.end is LiftEnd.HEAVY or (self.end is LiftEnd.LOST and self.allowed_N < self.needed_N)

    def in_words(self) -> str:
        """What to tell of it."""
        if not self.is_too_heavy or self.end is LiftEnd.HEAVY:
            return str(self.end)
        carried = f"{self.end}, which carried up to {self.carried_N:.1f} N with {self.squeezed_N:.2f} N each"
        return f"{carried}: at least {self.needed_N:.2f} N needed, at most {self.allowed_N:.2f} N allowed"
