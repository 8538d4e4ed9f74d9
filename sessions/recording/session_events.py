"""Session events: what the conductor meant, written between the bytes.

The bytes of the transports say what the devices measured; session events say what it was measured for. They are
recorded in order with the bytes, so a replay knows as much as the live session did.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from drivers.core.contacts import FINGERS
from drivers.core.errors import SessionError


class EventKind(StrEnum):
    """The meanings a event can have."""

    TARE = "tare"
    """The named fingers touch nothing: take this as zero."""
    CLOSE_BEGIN = "close_begin"
    """The open hand stands around the object: from here on the fingers close."""
    CAPTURE_BEGIN = "capture_begin"
    """The grasp has settled: gather samples from here on."""
    CAPTURE_END = "capture_end"
    """Enough samples: make a grasp of them."""
    TOUCH_END = "touch_end"
    """Enough samples of a probe: its contacts belong to the next grasp, which finds the object at rest there."""
    HOLD_BEGIN = "hold_begin"
    """The object is held firmly: from here on it moves with the palm."""
    HOLD_END = "hold_end"
    """The object is about to be let go: it stays where it is."""
    TRUTH_FRAME = "truth_frame"
    """The newest camera frame shows the object of the current grasp at rest."""
    UNDO = "undo"
    """The last grasp does not count: what the hand carried before and after it belongs to the next one."""


@dataclass(frozen=True)
class SessionEvent:
    """One event.

    Attributes:
        kind: its meaning.
        stamp_ns: session clock.
        fingers: the idle fingers, for a tare; all of them by default.
    """

    kind: EventKind
    stamp_ns: int
    fingers: tuple[str, ...] = FINGERS

    def to_bytes(self) -> bytes:
        """The event as JSON, the form in a traffic file."""
        content: dict[str, Any] = {"kind": self.kind.value, "stamp_ns": self.stamp_ns}
        if self.kind is EventKind.TARE:
            content["fingers"] = list(self.fingers)
        return json.dumps(content, separators=(",", ":")).encode()

    @classmethod
    def from_bytes(cls, data: bytes, *, where: str = "/marks") -> SessionEvent:
        """Read a event back.

        Raises:
            SessionError: the content is not a event of this version.
        """
        try:
            content = json.loads(data)
            fingers = tuple(str(finger) for finger in content.get("fingers", FINGERS))
            event = cls(EventKind(content["kind"]), int(content["stamp_ns"]), fingers)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise SessionError(
                f"not a mark that this version knows ({error!r})", where=where, hint="Use the version that recorded it"
            ) from error
        if unknown := set(fingers) - set(FINGERS):
            raise SessionError(f"mark names unknown fingers {sorted(unknown)}", where=where)
        return event
