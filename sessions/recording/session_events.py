"""Session events: the conductor's intentions, recorded between the bytes.

The bytes of the transports say what the devices measured; session events say what it was measured for. They are
recorded in order with the bytes, so that a replay has the same information as the live session.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from drivers.core.contacts import FINGERS
from drivers.core.errors import SessionDataError


class EventKind(StrEnum):
    """Kinds of session events."""

    TARE = "tare"
    """The named fingers touch nothing: tare them."""
    CLOSE_BEGIN = "close_begin"
    """The open hand is around the object: from now on the fingers close."""
    CAPTURE_BEGIN = "capture_begin"
    """The grasp has settled: collect samples from now on."""
    CAPTURE_END = "capture_end"
    """Enough samples: compute a grasp from them."""
    TOUCH_END = "touch_end"
    """Enough samples of a probe: its contacts belong to the next grasp, for which the object has not moved."""
    HOLD_BEGIN = "hold_begin"
    """The object is held firmly: from now on it moves with the palm."""
    HOLD_END = "hold_end"
    """The object is about to be released: it stays in place."""
    DRAG_BEGIN = "drag_begin"
    """The held object is dragged to and fro over the table from now on."""
    DRAG_END = "drag_end"
    """Enough: compute the table's friction."""
    HANG_BEGIN = "hang_begin"
    """The held object was lifted: it hangs, and is shifted to and fro from now on."""
    HANG_END = "hang_end"
    """Enough: compute its weight."""
    TRUTH_FRAME = "truth_frame"
    """The newest camera frame shows the object of the current grasp at rest."""
    OBJECT_MOVED = "object_moved"
    """The object was pushed since the last grasp: it was found again near by, standing as before."""
    OBJECT_FELL = "object_fell"
    """The object has fallen over since the last grasp: nothing that was felt of it before holds any more."""
    UNDO = "undo"
    """The last grasp is undone: the hand odometry before and after it belongs to the next one."""


@dataclass(frozen=True)
class SessionEvent:
    """One session event.

    Attributes:
        kind: its meaning.
        stamp_ns: session clock.
        fingers: the idle fingers, for a tare; all of them by default.
    """

    kind: EventKind
    stamp_ns: int
    fingers: tuple[str, ...] = FINGERS

    def to_bytes(self) -> bytes:
        """The event as JSON, as stored in a traffic file."""
        content: dict[str, Any] = {"kind": self.kind.value, "stamp_ns": self.stamp_ns}
        if self.kind is EventKind.TARE:
            content["fingers"] = list(self.fingers)
        return json.dumps(content, separators=(",", ":")).encode()

    @classmethod
    def from_bytes(cls, data: bytes, *, where: str = "/marks") -> SessionEvent:
        """Parse a session event.

        Raises:
            SessionError: the content is not a session event of this version.
        """
        try:
            content = json.loads(data)
            fingers = tuple(str(finger) for finger in content.get("fingers", FINGERS))
            event = cls(EventKind(content["kind"]), int(content["stamp_ns"]), fingers)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise SessionDataError(
                f"not a session event that this version knows ({error!r})",
                where=where,
                hint="Use the version that recorded it",
            ) from error
        if unknown := set(fingers) - set(FINGERS):
            raise SessionDataError(f"the session event names unknown fingers {sorted(unknown)}", where=where)
        return event
