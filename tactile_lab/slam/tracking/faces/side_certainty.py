"""Joint uncertainty of poses and the straight and round sides of an outline, as :mod:`facet_certainty` has it."""

from __future__ import annotations

from typing import Self

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.rounded_outline import RoundedOutline
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.side_smoothing import SideSmoother, rounded_outline


class SideCertainty:
    """Poses and sides at the solution, linearised; see :class:`.FacetCertainty` for what its names mean."""

    def __init__(self, contact_map: ContactMap, smoother: SideSmoother, outline: RoundedOutline) -> None:
        self._smoother, self._outline = smoother, outline
        information, free = smoother.information(), (len(contact_map.rows) - 1) * contact_map.space.size
        self._by_poses = -np.linalg.solve(information[free:, free:], information[free:, :free])
        of_poses = information[:free, :free] + information[:free, free:] @ self._by_poses
        self.information_of_poses: Array = (of_poses + of_poses.T) / 2
        self.poses_by_errors: Array = np.empty((free, 0))
        shared = contact_map.contacts_world.shared
        self._by_fingers = smoother.response(shared.displacements_m())[free:]
        self._by_contacts = smoother.response(shared.displacements_each_m())[free:]

    @classmethod
    def of(cls, contact_map: ContactMap, noise: MotionNoise) -> Self:
        """From poses of largest evidence, contacts in the plane. Raises ShapeError where no side is round."""
        outline = rounded_outline(contact_map)
        return cls(contact_map, SideSmoother(contact_map, noise, outline), outline)

    def surface_change(self, places_m: Array, normals: Array) -> Array:
        """Derivatives of places on the outline, shape (q, 2), along their normals by the poses, shape (q, p)."""
        return np.asarray(self._by_sides(places_m) @ self._by_poses)

    def shared_change(self, places_m: Array, normals: Array) -> Array:
        """Displacement of such places by one standard deviation of each finger's error, shape (q, fingers)."""
        return np.asarray(self._by_sides(places_m) @ self._by_fingers)

    def shared_change_each(self, places_m: Array, normals: Array) -> Array:
        """The same if each contact had such an error of its own, shape (q, n)."""
        return np.asarray(self._by_sides(places_m) @ self._by_contacts)

    def _by_sides(self, places_m: Array) -> Array:
        """Displacement of places by each free number of the side that they are on."""
        return self._smoother.free_numbers(self._outline.sides_at(places_m), places_m)
