"""Uncertainty of the straight faces of an outline."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.segmentation import Faces, PlanarContacts


@dataclass(frozen=True)
class FaceUncertainty:
    """Each face has independent errors: an offset along its normal at the middle of its contacts, and a rotation about
    this point.

    Attributes:
        faces: the faces.
        middles_m: position of each face's weighted middle along its tangent, shape (s,).
        offset_variances_m2: of each face at its middle, shape (s,).
        direction_variances: of each face's direction, square radians, shape (s,); faces of one direction group rotate
            together.
    """

    faces: Faces
    middles_m: Array
    offset_variances_m2: Array
    direction_variances: Array

    @classmethod
    def of(cls, contacts: PlanarContacts, faces: Faces) -> Self:
        """Uncertainty from the standard deviations of the contacts."""
        weights, stiffness = contacts.point_sigma_m**-2.0, contacts.normal_sigma_rad**-2.0
        along = np.sum(contacts.points_m * faces.tangents[faces.labels], axis=1)
        totals = np.bincount(faces.labels, weights, faces.count)
        middles = np.bincount(faces.labels, weights * along, faces.count) / totals
        turning = weights * (along - middles[faces.labels]) ** 2 + stiffness
        information = np.bincount(faces.direction_groups[faces.labels], turning)
        return cls(faces, middles, 1 / totals, 1 / information[faces.direction_groups])

    def scale(self, factor: float) -> Self:
        """The same with all standard deviations multiplied by a factor."""
        return replace(
            self,
            offset_variances_m2=factor**2 * self.offset_variances_m2,
            direction_variances=factor**2 * self.direction_variances,
        )

    def covariance(self, face: int) -> Array:
        """Covariance of (direction rad, offset m) of a face, the line being ``u . x = offset``, shape (2, 2)."""
        turning, middle = self.direction_variances[face], self.middles_m[face]
        offset = self.offset_variances_m2[face] + middle**2 * turning
        return np.array([[turning, middle * turning], [middle * turning, offset]])

    def variance_m2(self, face: int, places_m: Array) -> Array:
        """Variance along the normal of points of shape (q, 2) on a face, shape (q,)."""
        levers = self._levers_m(face, places_m)
        return np.asarray(self.offset_variances_m2[face] + levers**2 * self.direction_variances[face])

    def displacements_m(self, faces: NDArray[np.int64], places_m: Array) -> Array:
        """How one standard deviation of each error moves places along their normals, shape (q, s + groups).

        Args:
            faces: face of each place, shape (q,); negative where no face is, which nothing moves.
            places_m: shape (q, 2).
        """
        moves = np.zeros((len(places_m), self.faces.count + len(self.direction_variances)))
        for face in range(self.faces.count):
            here = np.flatnonzero(faces == face)
            turning = self.faces.count + self.faces.direction_groups[face]
            moves[here, face] = np.sqrt(self.offset_variances_m2[face])
            moves[here, turning] = self._levers_m(face, places_m[here]) * np.sqrt(self.direction_variances[face])
        return moves

    def _levers_m(self, face: int, places_m: Array) -> Array:
        return np.asarray(places_m @ self.faces.tangents[face] - self.middles_m[face])
