"""Contacts at the corners of an outline.

A fingertip that straddles a corner touches it with any normal between those of the two faces. Treated as separate
faces, such contacts would cut corners off; treated as outliers, they would be lost; treated as corner contacts, they
determine the corner. Concave corners are never touched like this: there the fingertip rests on both faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.segmentation import Faces, PlanarContacts, PRIOR_REACH_m, price_of_face

CORNER_SHARE = 0.1
"""Prior share of contacts at corners."""

_LEAST_ON_FACE = 3
"""Faces with fewer contacts may in fact be corners between larger faces."""

_LEAST_TURN_rad = float(np.deg2rad(20.0))
_CLEARLY = 4.0
"""Reduction of chi-square by which a corner must explain a contact better than a face."""


@dataclass(frozen=True)
class Corners:
    """Convex corners between successive faces.

    Attributes:
        places_m: shape (c, 2).
        directions_rad: angle of the outward normal of the face before each corner, counter-clockwise, shape (c,).
        turns_rad: angle from there to the normal of the face after the corner, positive, shape (c,).
    """

    places_m: Array
    directions_rad: Array
    turns_rad: Array

    @classmethod
    def between(cls, faces: Faces, pairs: NDArray[np.int64]) -> Self:
        """The convex corners among the given pairs of successive faces, shape (k, 2)."""
        before, after = faces.directions_rad[pairs].T
        turns = np.mod(after - before + np.pi, 2 * np.pi) - np.pi
        convex = (turns > _LEAST_TURN_rad) & (turns < np.pi - _LEAST_TURN_rad)
        chosen = pairs[convex]
        places = np.linalg.solve(faces.normals[chosen], faces.offsets_m[chosen][..., None])[..., 0]
        return cls(places, before[convex], turns[convex])

    def chi_squares(self, contacts: PlanarContacts) -> Array:
        """Chi-square of each contact at the corner that explains it best, shape (n,), comparable with that on a face.

        The point is at the corner, and the normal anywhere in between. Compared with a contact on a face, the position
        along the face is fixed and the direction is spread out; both are taken into account, and so is the rarity of
        such contacts.
        """
        if len(self.places_m) == 0:
            return np.full(len(contacts), np.inf)
        away = np.linalg.norm(contacts.points_m[:, None] - self.places_m, axis=2) / contacts.point_sigma_m[:, None]
        angles = np.arctan2(contacts.normals[:, 1], contacts.normals[:, 0])
        middles = self.directions_rad + self.turns_rad / 2
        off_middle = np.abs(np.mod(angles[:, None] - middles + np.pi, 2 * np.pi) - np.pi)
        beyond = np.maximum(off_middle - self.turns_rad / 2, 0.0) / contacts.normal_sigma_rad[:, None]
        given = PRIOR_REACH_m / contacts.point_sigma_m[:, None]
        spread = contacts.normal_sigma_rad[:, None] / self.turns_rad
        return np.asarray((away**2 + beyond**2 - 2 * np.log(CORNER_SHARE * given * spread)).min(axis=1))


def at_corners(contacts: PlanarContacts, faces: Faces) -> NDArray[np.bool_]:
    """Which contacts are explained clearly better by corners between larger faces than by their own faces, shape
    (n,).
    """
    sizes = np.bincount(faces.labels, minlength=faces.count)
    larger = np.flatnonzero(sizes >= _LEAST_ON_FACE)
    if len(larger) < 2:
        return np.zeros(len(contacts), dtype=bool)
    corners = Corners.between(faces, np.column_stack([larger, np.roll(larger, -1)]))
    price = np.where(sizes < _LEAST_ON_FACE, price_of_face(contacts.point_sigma_m, contacts.normal_sigma_rad), 0.0)
    on_face = _chi_squares_on_faces(contacts, faces) + (price / sizes)[faces.labels]
    return np.asarray(corners.chi_squares(contacts) < on_face - _CLEARLY)


def _chi_squares_on_faces(contacts: PlanarContacts, faces: Faces) -> Array:
    """Chi-square of each contact on its own face, shape (n,)."""
    outward = faces.normals[faces.labels]
    away = np.sum(contacts.points_m * outward, axis=1) - faces.offsets_m[faces.labels]
    tilt = 2 * (1 - np.sum(contacts.normals * outward, axis=1))
    return np.asarray((away / contacts.point_sigma_m) ** 2 + tilt / contacts.normal_sigma_rad**2)
