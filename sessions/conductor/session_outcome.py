"""How a session ended, and its grasps."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from drivers.core.contacts import Grasp
from drivers.core.errors import TactileLabError
from sessions.perception.weighing.object_properties import ObjectProperties


class Ending(StrEnum):
    """How a session ended."""

    COMPLETE = "complete"
    PARTIAL = "partial"
    """Less than asked for: nothing is left that the hand can reach."""
    OBJECT_LOST = "object lost"
    INTERRUPTED = "interrupted"
    LIMIT = "limit reached"
    STOPPED = "stopped"
    """A safety limit or a failing device; the outcome carries the error."""


@dataclass(frozen=True)
class SessionOutcome:
    """Outcome of a session.

    Attributes:
        ending: how it ended.
        reason: the same as a sentence.
        grasps: all captured grasps, in order.
        dropped: how often a finger's contact was rejected, by reason.
        error: what stopped the session, if something did.
        properties: mass, centre and friction of the object, as far as they were measured.
    """

    ending: Ending
    reason: str
    grasps: tuple[Grasp, ...]
    dropped: dict[str, int]
    error: TactileLabError | None = None
    properties: ObjectProperties = field(default_factory=ObjectProperties)

    def raise_if_interrupted(self) -> None:
        """Raises KeyboardInterrupt where a person interrupted the session: one of many, it is made again."""
        if self.ending is Ending.INTERRUPTED:
            raise KeyboardInterrupt
