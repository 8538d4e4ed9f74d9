"""What links may have done to the object from one grasp to the next, as the motors tell it.

A link pushes while the hand opens, where the open hand comes down on the object, and while it closes again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from drivers.core.contacts import Array
from drivers.core.fingertip import ContinuousFingertip
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_noise import LinkTimes
from sessions.perception.carrying.carry_record import CarryRecord, CarrySamples
from sessions.perception.carrying.links.link_pushes import LinkPushes, until_it_rises


class WatchedLinks:
    """Collects the readings of the motors while no fingertip is expected on the object, and what they say.

    Args:
        motors: which motor pulls which joint; None if that is not known: then nothing is heard.
        fingertips: that measure contacts while they move, by finger.
        side: of the hand.
    """

    def __init__(self, motors: MotorMap | None, fingertips: Mapping[str, ContinuousFingertip], side: Side) -> None:
        self._pushes = None if motors is None else LinkPushes(motors, fingertips, side)
        self._descent, self._opening = CarryRecord({} if motors is None else fingertips), CarryRecord(fingertips)
        self._tared_ns, self._let_go_ns, self._is_grasped = 0, 0, False
        self.times = LinkTimes()
        """Of the step that the last closing ended."""
        self.opened: CarrySamples | None = None
        """What the hand measured while it opened last, until it rose; None for too little."""

    @property
    def are_heard(self) -> bool:
        """Whether it is known which motor pulls which joint."""
        return self._pushes is not None

    @property
    def is_watching(self) -> bool:
        """Whether :meth:`on_hand` is wanted."""
        return self._descent.is_open or self._opening.is_open

    def on_hand(self, stamp_ns: int, joints_rad: Array, world_T_forearm: Array, motor_counts: Array | None) -> None:
        """One sample of the hand; see :class:`~sessions.perception.carrying.carry_record.CarrySample`."""
        for record in (self._descent, self._opening):
            if record.is_open:
                record.take(stamp_ns, joints_rad, world_T_forearm, motor_counts)

    def on_closing(self, samples: CarrySamples | None) -> None:
        """The hand has closed."""
        closed_s = 0.0 if samples is None or self._pushes is None else self._pushes.closed_s(samples)
        self.times = replace(self.times, closed_s=closed_s)

    def on_grasp(self) -> None:
        """The object is grasped: a step ends."""
        self._is_grasped = True

    def on_let_go(self, stamp_ns: int) -> None:
        """The hand begins to open: a step begins."""
        self._let_go_ns = stamp_ns
        self._opening.begin()

    def on_left(self) -> None:
        """The hand is no longer at the object: whatever links pushed since it was let go of counts."""
        if self._is_grasped:
            opening = self._opening.since(self._let_go_ns) if self._opening.is_open else None
            self.opened = None if opening is None else until_it_rises(opening)
            opened_s = 0.0 if self.opened is None or self._pushes is None else self._pushes.opened_s(self.opened)
            self.times, self._is_grasped = LinkTimes(opened_s=opened_s), False
        self._opening.end()
        self._descent.end()

    def on_tare(self, stamp_ns: int) -> None:
        """The hand is above the object and free, and comes down for it; or it has risen to come down again."""
        self.on_close(stamp_ns)
        self.on_left()
        self._tared_ns = stamp_ns
        self._descent.begin()

    def on_close(self, stamp_ns: int) -> None:
        """The fingers begin to close: whatever links landed on from the tare until now counts."""
        down = self._descent.since(self._tared_ns) if self._descent.is_open else None
        down = None if down is None else down.until(stamp_ns)
        if down is not None and self._pushes is not None:
            self.times = replace(self.times, landed_s=self.times.landed_s + self._pushes.landed_s(down))
        self._descent.end()
