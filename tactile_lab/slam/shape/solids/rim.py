"""The rim of what may be open from above: contacts that face up and are among the highest, level or leaning."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.spatial import Delaunay, QhullError

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.surface import Mask

UPWARD = 0.7
"""Least vertical part of a normal on the rim."""

BELOW_m = 0.004
"""So far below the rim a finger is inside."""

_RIM_m = 0.020
"""Contacts on the rim are no lower below the highest."""

_BESIDE_m = 0.015
"""Contacts on walls so far below it are around what is inside: necks are longer."""

_ALIKE_rad = float(np.deg2rad(60.0))
"""A rim is about as far from its middle in directions that differ by less."""

_LEANS_rad = (float(np.deg2rad(5.0)), float(np.deg2rad(25.0)))
"""Of a rim that is not level."""

_LEAST, _FLAT_m = 5, 0.005
"""Contacts that tell that, and how far the farthest may be from their plane."""

_LEVEL = np.zeros(2)


@dataclass(frozen=True)
class Rim:
    """Contacts on a rim.

    Attributes:
        chosen: which of the contacts, shape (n,).
        contacts_m: their places, shape (k, 3).
        beside_m: places of contacts beside it, close below, shape (m, 3).
        slope: by how much it rises along x and y, shape (2,).
    """

    chosen: Mask
    contacts_m: Array
    beside_m: Array
    slope: Array

    @classmethod
    def of(cls, gpis: Gpis) -> Self:
        """Of the contacts of a field; perhaps with none on it."""
        heights_m = gpis.contacts_m[:, 2]
        chosen = np.asarray((gpis.normals[:, 2] > UPWARD) & (heights_m > heights_m.max() - _RIM_m))
        contacts_m, others_m = gpis.contacts_m[chosen], gpis.contacts_m[gpis.normals[:, 2] <= UPWARD]
        rim = cls(chosen, contacts_m, others_m, _slope(contacts_m))
        return replace(rim, beside_m=others_m[rim.depths_m(others_m) < _BESIDE_m])

    def depths_m(self, places_m: Array) -> Array:
        """How far places (q, 3) are below it, shape (q,): below its highest contact where it is level."""
        return np.asarray(self._heights_m(self.contacts_m).max(initial=-np.inf) - self._heights_m(places_m))

    def _heights_m(self, places_m: Array) -> Array:
        return np.asarray(places_m[:, 2] - places_m[:, :2] @ self.slope)

    def seen_m(self, places_m: Array) -> Array:
        """Places (q, 3) as they are seen along the direction in which it faces, shape (q, 2): from above, if level."""
        aside = self.slope / (1 + self.slope @ self.slope)
        return np.asarray(places_m[:, :2] + self._heights_m(places_m)[:, None] * aside)

    @property
    def top_m(self) -> float:
        """Height of its highest contact."""
        return float(self.contacts_m[:, 2].max(initial=-np.inf))

    @property
    def highest_m(self) -> Array:
        """The contacts that are no lower on it than fingers must be to be inside, shape (k, 3)."""
        return np.asarray(self.contacts_m[self.depths_m(self.contacts_m) < 2 * BELOW_m])

    def encloses(self, places_m: Array, middle_m: Array, by_m: float = 0.0) -> Mask:
        """Which places (q, 3), seen so, are nearer to a middle (3,) than the rim in their direction, by a margin; none
        where the rim is not known in about that direction.
        """
        if not len(self.highest_m):
            return np.zeros(len(places_m), dtype=bool)
        middle = self.seen_m(middle_m[None])
        away_m, around_m = ((self.seen_m(each) - middle) @ [1.0, 1.0j] for each in (places_m, self.highest_m))
        is_known = (np.abs(np.angle(away_m[:, None] * around_m.conj())) < _ALIKE_rad).any(axis=1)
        there_m = np.interp(np.angle(away_m), np.angle(around_m), np.abs(around_m), period=2 * np.pi)
        return np.asarray(is_known & (np.abs(away_m) < there_m - by_m))

    def surrounded(self, places_m: Array, around_m: Array) -> Mask:
        """Which places, seen so, others surround; shapes (q, 3), (n, 3)."""
        try:
            return np.asarray(Delaunay(self.seen_m(around_m)).find_simplex(self.seen_m(places_m)) >= 0)
        except (QhullError, ValueError):  # they are in a line, or none
            return np.zeros(len(places_m), dtype=bool)


def _slope(contacts_m: Array) -> Array:
    """Of the plane through contacts on a rim that leans, otherwise none."""
    if len(contacts_m) < _LEAST:
        return _LEVEL
    across = np.column_stack([contacts_m[:, :2], np.ones(len(contacts_m))])
    plane, _, rank, _ = np.linalg.lstsq(across, contacts_m[:, 2], rcond=None)
    is_flat = rank == across.shape[1] and np.abs(across @ plane - contacts_m[:, 2]).max() < _FLAT_m
    leans = _LEANS_rad[0] < np.arctan(np.hypot(*plane[:2])) < _LEANS_rad[1]
    return np.asarray(plane[:2]) if is_flat and leans else _LEVEL
