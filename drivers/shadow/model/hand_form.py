"""Which hand it is: its side, and the joints that it has.

A left hand is the right one mirrored in the palm's y-z plane, as in Shadow's published model of it. Lite and extra-lite
hands lack fingers, the wrist and THJ3; what such a hand does not have stays at zero in every joint vector.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from drivers.core.contacts import FINGERS
from drivers.shadow.model.kinematics import JOINTS
from drivers.shadow.model.motors import DRIVEN_JOINTS, angles_of_driven
from drivers.shadow.protocol.palm_images import Side


@dataclass(frozen=True)
class HandForm:
    """Side and joints of a hand.

    Attributes:
        side: of the body that it belongs to.
        driven: the driven joints that it has, in the order of :data:`DRIVEN_JOINTS`.
    """

    side: Side = "right"
    driven: tuple[str, ...] = DRIVEN_JOINTS

    @cached_property
    def fingers(self) -> tuple[str, ...]:
        """The fingers that it has, in the order of :data:`FINGERS`."""
        return tuple(finger for finger in FINGERS if any(name.startswith(finger) for name in self.driven))

    @cached_property
    def long_fingers(self) -> tuple[str, ...]:
        """Those that the thumb opposes."""
        return tuple(finger for finger in self.fingers if finger != "TH")

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """The joints that turn, in the order of :data:`JOINTS`."""
        turning = {joint for name in self.driven for joint in angles_of_driven(name)}
        return tuple(joint for joint in JOINTS if joint in turning)

    @property
    def is_left(self) -> bool:
        """Whether it is a left hand."""
        return self.side == "left"

    @property
    def handedness(self) -> float:
        """Factor of what is mirrored from a right hand to a left one: 1 for a right hand, -1 for a left one."""
        return -1.0 if self.is_left else 1.0

    @property
    def mirrored(self) -> HandForm:
        """The same hand of the other side."""
        return replace(self, side="right" if self.is_left else "left")

    def __str__(self) -> str:
        """In words, for people."""
        return f"{self.side} hand with {', '.join(self.fingers)}"


RIGHT_HAND = HandForm()
"""The right hand with five fingers."""
