"""Samples collected while the fingers touch, and the selection of valid contacts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact
from drivers.core.fingertip import FingertipSensor, TipContact
from sessions.perception.contact_world import HandGeometry


class TouchSelection:
    """Selects valid touches.

    Args:
        fingertips: sensors, by finger.
        minimum_force_N: a lighter touch does not count as a contact.
    """

    def __init__(self, fingertips: Mapping[str, FingertipSensor], minimum_force_N: float) -> None:
        self._fingertips, self._minimum_force_N = fingertips, minimum_force_N
        self.dropped: dict[str, str] = {}
        """Fingers without a contact in the last grasp, and why."""
        self.drop_counts: Counter[str] = Counter()
        """The reasons over the whole session."""

    def touches(self, geometry: HandGeometry, *, heard: bool) -> dict[str, TipContact]:
        """The valid touches; :attr:`dropped` has the reasons for rejected ones.

        Args:
            geometry: the hand during the capture.
            heard: whether joint angles arrived during it.
        """
        tips, self.dropped = {}, {}
        for finger, fingertip in self._fingertips.items():
            tip = fingertip.contact(geometry.world_T_distal[FINGERS.index(finger), :3, :3])
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


@dataclass(frozen=True)
class Capture:
    """Samples since a capture began."""

    stamp_ns: int
    joints_rad: list[Array] = field(default_factory=list)
    base_q: list[Array] = field(default_factory=list)

    def joints(self, otherwise: Array) -> Array:
        """Mean joint angles, shape (24,), radians."""
        return _mean(self.joints_rad, otherwise)

    def base(self, otherwise: Array) -> Array:
        """Mean positioner joints, shape (6,), metres and radians."""
        return _mean(self.base_q, otherwise)


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


def _mean(samples: list[Array], otherwise: Array) -> Array:
    return np.asarray(np.mean(samples, axis=0)) if samples else otherwise
