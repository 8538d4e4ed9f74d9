"""Approach paths of the fingertips while they closed: free space that the object does not fill.

A fingertip's surface is modelled as an ellipsoid. A path starts at its leading point in the direction of motion, and
ends at the contact, or at the leading point where the finger stopped. Start and end lie on the tip, and a convex tip
that moves straight covers the straight line between them: no part of that line can be inside the object.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact

_LEAST_WAY_m = 0.002
"""A finger that moved less than this has no approach path."""


@dataclass(frozen=True)
class TipSurface:
    """The touching surface of a fingertip as an ellipsoid.

    Attributes:
        semi_axes_m: along its own axes, shape (3,).
        distal_T_tip: its centre and axes in the finger's distal frame.
    """

    semi_axes_m: Array
    distal_T_tip: Pose3

    @classmethod
    def upright(cls, semi_axes_m: Iterable[float], centre_distal_m: Iterable[float]) -> TipSurface:
        """An ellipsoid with the axes of the distal frame."""
        pose = np.eye(4)
        pose[:3, 3] = list(centre_distal_m)
        return cls(np.array(list(semi_axes_m)), Pose3(pose))

    def leading_point(self, world_T_distal: Array, direction_world: Array) -> Array:
        """The point of the surface that is farthest along a direction, shape (3,), world frame.

        Args:
            world_T_distal: homogeneous matrix, shape (4, 4).
            direction_world: unit vector, shape (3,).
        """
        world_T_tip = world_T_distal @ self.distal_T_tip.matrix()
        stretched = self.semi_axes_m * (world_T_tip[:3, :3].T @ direction_world)
        along = self.semi_axes_m * stretched / np.linalg.norm(stretched)
        return np.asarray(world_T_tip[:3, :3] @ along + world_T_tip[:3, 3])

    def centre(self, world_T_distal: Array) -> Array:
        """Its centre, shape (3,), world frame."""
        return np.asarray((world_T_distal @ self.distal_T_tip.matrix())[:3, 3])


def way_of(tip: TipSurface, begun: Array, ended: Array) -> Array | None:
    """The direction in which a fingertip moved, world frame, shape (3,); None if it hardly did.

    Args:
        tip: its surface.
        begun, ended: its distal frame in the world before and after, shape (4, 4).
    """
    way = tip.centre(ended) - tip.centre(begun)
    length_m = float(np.linalg.norm(way))
    return None if length_m < _LEAST_WAY_m else way / length_m


def approach_paths(
    begun: Array, ended: Array, tips: Mapping[str, TipSurface], contacts: Iterable[Contact]
) -> tuple[ApproachPath, ...]:
    """The approach paths of all fingers that moved, in the order of :data:`FINGERS`.

    Args:
        begun, ended: the distal frames in the world at the start and end of the closing, shape (5, 4, 4).
        tips: surfaces of the fingertips, by finger.
        contacts: those of the grasp.
    """
    touched = {contact.finger: contact.point_world_m for contact in contacts}
    found = []
    for finger, start, end in zip(FINGERS, begun, ended, strict=True):
        if finger not in tips:
            continue
        tip = tips[finger]
        if (ahead := way_of(tip, start, end)) is None:
            continue
        first = tip.leading_point(start, ahead)
        last = touched[finger] if finger in touched else tip.leading_point(end, ahead)
        found.append(ApproachPath(finger, first, last, finger in touched))
    return tuple(found)
