"""Follows an object from the moment it is grasped until it is let go."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from drivers.core.contacts import Array, StepSigma
from drivers.core.fingertip import ContinuousFingertip, FingertipSensor
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry import Carry, CarryOdometry
from sessions.perception.carrying.carry_record import CarryRecord, CarrySamples
from sessions.perception.carrying.force_delay import ForceDelay
from sessions.perception.carrying.given_way import given_way_m, pushed_open_m
from sessions.perception.carrying.links.watched_links import WatchedLinks
from sessions.perception.carrying.net_wrench import largest_net_N
from sessions.perception.carrying.slip import Slip, slip
from sessions.perception.carrying.tip_steps import tip_steps
from sessions.perception.touch_capture import Measured


class HeldObject:
    """Collects the readings of hand and fingertips from a capture on, and estimates the carry when a hold ends.

    The object begins to slip when the fingers squeeze it, which is before the hold: so the capture is the beginning.
    It ends with the hold. While the fingers open, they leave one after the other, and light contacts mislead.

    Args:
        fingertips: of the rig, by finger; none for no odometry.
        side: of the hand.
        scale: factor of the stated standard deviations.
        motors: which motor pulls which joint; None if that is not known.
    """

    def __init__(
        self,
        fingertips: Mapping[str, FingertipSensor],
        side: Side,
        scale: float = 1.0,
        motors: MotorMap | None = None,
    ) -> None:
        self.fingertips = {f: tip for f, tip in fingertips.items() if isinstance(tip, ContinuousFingertip)}
        self._record = CarryRecord(self.fingertips)
        self.odometry = CarryOdometry(self.fingertips, side, scale)
        """Estimates the carries."""

        self._from_ns, self._side, self._is_grasped = 0, side, False
        self.links = WatchedLinks(motors, self.fingertips, side)
        """What they may have done to the object."""
        self.delay = ForceDelay(self.fingertips, side)
        """How late forces arrive."""
        self.closing_N = 0.0
        """Largest net force of the fingertips along the table while the hand closed for the last capture.

        What they feel balances itself, but for what moves the object, and for links on its other side.
        """

        self.given_way_m, self._moved_m = 0.0, 0.0
        """How far the object moved under the fingertips of the last closing, and most since it was let go."""
        self.contact_height_m = 0.0
        """Mean height of the last capture's contacts above the table."""
        self.carry: Carry | None = None
        """The last completed one; None if the fingertips measured nothing."""
        self.samples: CarrySamples | None = None
        """What hand and fingertips measured in it."""

    @property
    def is_watched(self) -> bool:
        """Whether an object is grasped, or is going to be, and :meth:`on_hand` is wanted."""
        return self._record.is_open or self.links.is_watching

    def on_hand(
        self, stamp_ns: int, joints_rad: Array, world_T_forearm: Array, motor_counts: Array | None = None
    ) -> None:
        """Joint angles, shape (24,), the forearm's pose, shape (4, 4), and the motors' strain gauges, shape (20,)."""
        self.links.on_hand(stamp_ns, joints_rad, world_T_forearm, motor_counts)
        if self._record.is_open:
            self._record.take(stamp_ns, joints_rad, world_T_forearm, motor_counts)

    def on_tare(self, stamp_ns: int) -> None:
        """The hand is above the object and free, and comes down for it; or it has risen to come down again."""
        self._record.end()
        self.links.on_tare(stamp_ns)
        if self._is_grasped:
            self._moved_m, self._is_grasped = self._pushed_open_m(), False

    def _pushed_open_m(self) -> float:
        opened = self.links.opened
        return 0.0 if opened is None else pushed_open_m(tip_steps(opened, self.fingertips, self._side))

    def on_close(self, stamp_ns: int) -> None:
        """The fingers begin to close; the object may be pushed."""
        self.links.on_close(stamp_ns)
        self._from_ns = stamp_ns
        self._record.begin()

    def on_capture(self, stamp_ns: int) -> None:
        """The fingers have closed and rest: whatever moves the object from now on counts."""
        closing = self._record.since(self._from_ns) if self._record.is_open else None
        self.closing_N, self.given_way_m = 0.0, 0.0
        self.links.on_closing(closing)
        if closing is not None:
            self._take_closing(closing)
        self._from_ns = stamp_ns
        self._record.begin()

    def _take_closing(self, closing: CarrySamples) -> None:
        """What pushed the object while the hand closed, and how far."""
        self.closing_N = largest_net_N(closing, self.fingertips, self._side)
        self.given_way_m = given_way_m(tip_steps(closing, self.fingertips, self._side))
        self._moved_m = max(self._moved_m, self.given_way_m)
        self.delay.on_closing(closing)

    def on_grasp(self, measured: Measured) -> None:
        """The capture's contacts; the object was where they say in the middle of the capture."""
        self._from_ns, self._is_grasped = measured.stamp_ns, True
        self.links.on_grasp()
        if measured.contacts:
            self.contact_height_m = float(np.mean([contact.point_world_m[2] for contact in measured.contacts]))
        self.odometry.on_grasp(measured.contacts)

    def on_hold(self, stamp_ns: int) -> None:
        """The hand begins to carry the object."""
        if not self._record.is_open:
            self.on_capture(stamp_ns)

    def on_left(self) -> None:
        """The object is not held."""
        self._record.end()
        self.links.on_left()

    def samples_since(self, stamp_ns: int) -> CarrySamples | None:
        """Readings of hand and fingertips since a moment of this grasp; None for too little."""
        return self._record.since(stamp_ns)

    def carried_until(self, stamp_ns: int) -> Carry | None:
        """The carry from the capture until a moment since; None if the fingertips measured nothing."""
        samples = self._record.since(self._from_ns)
        samples = None if samples is None else samples.until(stamp_ns)
        return None if samples is None else self.odometry.estimate(samples)

    def slip_since(self, stamp_ns: int) -> Slip | None:
        """How far the object has slipped since a moment of this grasp; None if the fingertips do not tell it."""
        samples = self._record.since(stamp_ns)
        return None if samples is None else slip(samples, self.fingertips, self._side, self.odometry.friction)

    @property
    def stood(self) -> StepSigma | None:
        """How far an object that nobody carried may have moved, before the hand closed around it; None where pushes
        are not felt: without fingertips that measure them, or without motors that tell of links.
        """
        return self.odometry.stood if self.fingertips and self.links.are_heard else None

    def then_closed(self, sigma: StepSigma | None) -> StepSigma | None:
        """How well the object's motion is known at a capture, of what was known of it when the hand had opened."""
        return None if sigma is None else self.odometry.closed(sigma, self.closing_N, self.links.times, self._moved_m)

    def end_hold(self, until_ns: int | None = None) -> Carry | None:
        """The carry since the capture; the object is held on if ``until_ns`` is given, which is now."""
        samples = self.samples = self._record.since(self._from_ns)
        self.carry = None if samples is None else self.odometry.estimate(samples)
        if until_ns is None:
            self._record.end()
            self.links.on_let_go(self._from_ns if samples is None else int(samples.stamps_ns[-1]))
        return self.carry
