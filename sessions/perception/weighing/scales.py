"""Weighs the held object: what was felt between the beginning and the end of a lift, or of a drag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import SessionError
from drivers.shadow.protocol.palm_images import Side
from sessions.perception.carrying.carry_record import CarrySamples
from sessions.perception.carrying.held_object import HeldObject
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.weighing import Dragging, Hanging, dragging, hanging, until_it_slips
from sessions.recording.session_events import EventKind, SessionEvent


class Scales:
    """Measures with the fingertips of a held object.

    Args:
        held: the object, as followed since its capture.
        side: of the hand.
        joint_sigma_rad: constant error of each joint angle.
    """

    def __init__(self, held: HeldObject, side: Side, joint_sigma_rad: float) -> None:
        self._held, self._side, self._joint_sigma_rad = held, side, joint_sigma_rad
        self._from_ns: int | None = None
        self.properties = ObjectProperties()

    def event(self, event: SessionEvent, grasp_index: int) -> Dragging | Hanging | None:
        """A drag or a lift begins or ends. Returns the result; None if the fingertips measured nothing.

        Raises:
            SessionError: an end without a beginning.
        """
        if event.kind is EventKind.DRAG_END:
            return self._end_dragging(grasp_index)
        if event.kind is EventKind.HANG_END:
            return self._end_hanging(grasp_index)
        self._from_ns = event.stamp_ns
        return None

    def undo(self, grasp_index: int) -> None:
        """Forget what was measured after a grasp that does not count."""
        self.properties.undo(grasp_index)
        self._tell_odometry()

    def _tell_odometry(self) -> None:
        """Later carries of the object are followed with what is known of it now."""
        self._held.odometry.measured = self.properties.friction

    def on_carry(self, sliding: Array, grasp_index: int) -> None:
        """Hear the force ratios at the contacts that slid in a carry."""
        self.properties.sliding.append((grasp_index, sliding))
        self._tell_odometry()

    def _end_dragging(self, grasp_index: int) -> Dragging | None:
        samples = self._held.samples_since(self._begun_ns())
        if samples is None:
            return None
        found = dragging(samples, self._held.fingertips, self._side)
        self.properties.draggings.append((grasp_index, found))
        self._tell_odometry()
        return found

    def _end_hanging(self, grasp_index: int) -> Hanging | None:
        begun_ns = self._begun_ns()
        samples, carried = self._held.samples_since(begun_ns), self._held.carried_until(begun_ns)
        if samples is None:
            return None
        if (before := self.properties.hung_in(grasp_index)) is not None:
            found = self._weigh_again(samples, before)
        else:
            found = self._hanging(samples)
            if carried is not None:
                back = np.asarray(carried.motion.transformTo(found.centre_m))
                sigma_m = np.hypot(found.centre_sigma_m, carried.sigma.translation_m)
                found = replace(found, centre_m=back, centre_sigma_m=sigma_m)
            self.properties.hangings.append((grasp_index, found))
        self._tell_odometry()
        return found

    def _weigh_again(self, samples: CarrySamples, before: Hanging) -> Hanging:
        """Of one lift the more certain weight counts; the centre is where it was at first, before the object crept."""
        steady = until_it_slips(samples, self._held.fingertips, self._side)
        found = before if steady is None else self._hanging(steady)
        if not (found.is_free and found.weight_sigma_N < before.weight_sigma_N):
            return before
        found = replace(found, centre_m=before.centre_m, centre_sigma_m=before.centre_sigma_m)
        self.properties.hangings[-1] = self.properties.hangings[-1][0], found
        return found

    def _hanging(self, samples: CarrySamples) -> Hanging:
        return hanging(samples, self._held.fingertips, self._side, self._joint_sigma_rad, self._held.contact_height_m)

    def _begun_ns(self) -> int:
        if self._from_ns is None:
            text = "the end of a lift or drag without its beginning"
            raise SessionError(text, where="/marks", hint="The session events are out of order")
        begun_ns, self._from_ns = self._from_ns, None
        return begun_ns
