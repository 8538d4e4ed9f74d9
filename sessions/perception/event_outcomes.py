"""What a session event completes: a grasp, a picture that shows the truth, a tare, an undo, or a weighing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from drivers.core.contacts import Grasp
from sessions.perception.instruments import FrameReading
from sessions.perception.weighing.weighing import Dragging, Hanging


@dataclass(frozen=True)
class TruthFrame:
    """A camera frame that shows the object at rest.

    Attributes:
        grasp_index: the grasp being captured, otherwise the last one; None before the first.
        frame: the picture.
    """

    grasp_index: int | None
    frame: FrameReading


@dataclass(frozen=True)
class TareReport:
    """Outcome of a tare: the fingers that could not be zeroed, and why."""

    stamp_ns: int
    refused: Mapping[str, str]


@dataclass(frozen=True)
class Undone:
    """The grasp with this number was undone; the next one gets its number."""

    index: int


Outcome: TypeAlias = Grasp | TruthFrame | TareReport | Undone | Dragging | Hanging
