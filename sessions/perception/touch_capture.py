"""From the samples while the fingers touch to contacts: what a capture measures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact
from drivers.core.errors import SessionDataError
from drivers.core.fingertip import FingertipSensor, PressureFingertip, TipContact
from sessions.perception.approach_paths import TipSurface, approach_paths, way_of
from sessions.perception.contact_world import HandGeometry, MountUncertainty
from sessions.perception.hand_placement import HandPlacement
from sessions.recording.session_events import SessionEvent

_UNPLACED_m, _UNPLACED_ACROSS_m, _UNPLACED_rad = 0.0015, 0.004, 0.6
"""Standard deviations of a contact whose place on the fingertip is not felt: along the fingertip's way, across it, and
of its normal. It may be anywhere on the half of the tip that went ahead."""


@dataclass(frozen=True)
class Measured:
    """The result of one capture."""

    stamp_ns: int
    world_T_palm: Array
    contacts: tuple[Contact, ...]
    ways: tuple[ApproachPath, ...]


@dataclass
class Probed:
    """Contacts and approach paths of the probes since the object was last moved, kept for the next grasp."""

    contacts: list[Contact] = field(default_factory=list)
    ways: list[ApproachPath] = field(default_factory=list)

    def add(self, measured: Measured) -> None:
        self.contacts += [replace(contact, probed=True) for contact in measured.contacts]
        self.ways += measured.ways


@dataclass(frozen=True)
class _Samples:
    """What arrived since a capture began."""

    stamp_ns: int
    joints_rad: list[Array] = field(default_factory=list)
    base_q: list[Array] = field(default_factory=list)


@dataclass(frozen=True)
class ContactErrors:
    """What contacts are uncertain by, beside their sensors' own errors.

    Attributes:
        joint_sigma_rad: standard deviation of each joint angle that averaging does not remove.
        mount: the forearm-to-world calibration's; None if unknown.
    """

    joint_sigma_rad: float
    mount: MountUncertainty | None = None


class TouchCapture:
    """Measures what the fingertips touch, each time from a beginning to an end.

    Args:
        fingertips: sensors, by finger.
        hand: where the hand is.
        minimum_force_N: a lighter touch does not count as a contact.
        errors: of the contacts.
        tip_surfaces: of the fingertips whose approach paths are computed, by finger.
    """

    def __init__(
        self,
        fingertips: Mapping[str, FingertipSensor],
        hand: HandPlacement,
        minimum_force_N: float,
        errors: ContactErrors,
        tip_surfaces: Mapping[str, TipSurface],
    ) -> None:
        self._fingertips, self._hand, self._minimum_force_N = fingertips, hand, minimum_force_N
        self._errors, self._tip_surfaces = errors, dict(tip_surfaces)
        self._samples: _Samples | None = None
        self._closing_start: HandGeometry | None = None
        self.dropped: dict[str, str] = {}
        """Fingers without a contact in the last capture, and why."""
        self.drop_counts: Counter[str] = Counter()
        """The reasons over the whole session."""

    @property
    def is_open(self) -> bool:
        """Whether a capture has begun and not ended."""
        return self._samples is not None

    def on_close(self) -> None:
        """The fingers begin to close: their approach paths begin here. Raises DeviceError without samples."""
        self._closing_start = self._hand.current()

    def on_joints(self, joints_rad: Array) -> None:
        """Joint angles of the hand, shape (24,), radians."""
        if self._samples is not None:
            self._samples.joints_rad.append(joints_rad)

    def on_base(self, base_q: Array) -> None:
        """Joints of the positioner, shape (6,), metres and radians."""
        if self._samples is not None:
            self._samples.base_q.append(base_q)

    def begin(self, stamp_ns: int) -> None:
        """Collect from now on. Raises DeviceError without samples of hand and positioner."""
        self._hand.latest()
        for fingertip in self._fingertips.values():
            fingertip.begin_capture()
        self._samples = _Samples(stamp_ns)

    def abandon(self) -> None:
        """Forget what was collected."""
        self._samples = None

    def end(self, event: SessionEvent) -> Measured:
        """Contacts and geometry from the samples since the beginning. Raises SessionError if there was none."""
        samples, self._samples = self._samples, None
        if samples is None:
            text = f"{event.kind.value} without capture_begin"
            raise SessionDataError(text, where="/marks", hint="The session events are out of order")
        joints_rad, base_q = self._hand.latest()
        geometry = self._hand.place(_mean(samples.joints_rad, joints_rad), _mean(samples.base_q, base_q))
        tips = self._valid_touches(geometry, heard=bool(samples.joints_rad))
        contacts = geometry.contacts(tips, self._errors.joint_sigma_rad, self._errors.mount)
        stamp_ns = (samples.stamp_ns + event.stamp_ns) // 2
        return Measured(stamp_ns, geometry.world_T_palm, contacts, self._ways(geometry, contacts))

    def _valid_touches(self, geometry: HandGeometry, *, heard: bool) -> dict[str, TipContact]:
        tips, self.dropped = {}, {}
        for finger, fingertip in self._fingertips.items():
            world_T_distal = geometry.world_T_distal[FINGERS.index(finger)]
            tip = fingertip.contact(world_T_distal[:3, :3]) or self._foremost(finger, fingertip, world_T_distal)
            if tip is None:
                self.dropped[finger] = "no contact"
            elif not heard:
                self.dropped[finger] = "no joint angles during the capture"
            elif tip.force_N < self._minimum_force_N:
                self.dropped[finger] = "force below the minimum"
            else:
                tips[finger] = tip
        self.drop_counts.update(self.dropped.values())
        return tips

    def _foremost(self, finger: str, fingertip: FingertipSensor, world_T_distal: Array) -> TipContact | None:
        """The contact of a fingertip that is pressed but cannot tell where: foremost on its way. None for others."""
        begun, surface = self._closing_start, self._tip_surfaces.get(finger)
        if begun is None or surface is None or not isinstance(fingertip, PressureFingertip):
            return None
        ahead_world = way_of(surface, begun.world_T_distal[FINGERS.index(finger)], world_T_distal)
        if ahead_world is None or (force_N := fingertip.pressed_N()) is None:
            return None
        distal_R_world = world_T_distal[:3, :3].T
        ahead = distal_R_world @ ahead_world
        along = np.outer(ahead, ahead)
        return TipContact(
            point_distal_m=distal_R_world
            @ (surface.leading_point(world_T_distal, ahead_world) - world_T_distal[:3, 3]),
            normal_distal=-ahead,
            point_covariance_m2=_UNPLACED_m**2 * along + _UNPLACED_ACROSS_m**2 * (np.eye(3) - along),
            normal_sigma_rad=_UNPLACED_rad,
            force_N=force_N,
            torsion_Nm=0.0,
        )

    def _ways(self, geometry: HandGeometry, contacts: tuple[Contact, ...]) -> tuple[ApproachPath, ...]:
        """Approach paths of this grasp; a second capture after the same closing has none."""
        begun, self._closing_start = self._closing_start, None
        if begun is None:
            return ()
        return approach_paths(begun.world_T_distal, geometry.world_T_distal, self._tip_surfaces, contacts)


def _mean(samples: list[Array], otherwise: Array) -> Array:
    return np.asarray(np.mean(samples, axis=0)) if samples else otherwise
