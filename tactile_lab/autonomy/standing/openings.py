"""What of an object is open from above, as taps tell that met nothing, and what would be new inside it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from drivers.core.contacts import Array

_MISSED_m, _OPEN_m = 0.012, 0.025
"""A fingertip that comes down so far from all contacts has met nothing, and the next one so near would not either."""

_AROUND_rad = np.radians(120.0)
"""Something is an opening if contacts are seen from it in all directions, with no gap as wide as that."""

_STEP_m = 0.004
"""In which its middle is looked for."""

_ALIKE = 0.3
"""Least cosine between normals of what faces alike."""


def nowhere() -> Array:
    """No places, shape (0, 3)."""
    return np.empty((0, 3))


def to_nearest_m(places_m: Array, others_m: Array) -> Array:
    """Of places (n, 3) to the nearest of others (m, 3), shape (n,); infinite where there is none."""
    return np.asarray(cdist(places_m, others_m).min(axis=1, initial=np.inf))


@dataclass
class Openings:
    """Openings of one object."""

    _missed_m: Array = field(default_factory=nowhere)
    _looked_m: Array = field(default_factory=nowhere)
    _looked_normals: Array = field(default_factory=nowhere)
    """Where contacts were expected inside, and outward normals there."""

    def on_missed(self, places_m: Array, apart_m: Array) -> None:
        """Fingertips of a tap were expected at these places, (n, 3), world, so far from all contacts, shape (n,)."""
        self._missed_m = np.vstack([self._missed_m, places_m[apart_m > _MISSED_m]])

    def on_looked(self, places_m: Array, normals: Array) -> None:
        """Contacts were expected inside at these places, with outward normals, shape (n, 3) each, world: found there,
        elsewhere or nowhere, they are no longer new.
        """
        self._looked_m = np.vstack([self._looked_m, places_m])
        self._looked_normals = np.vstack([self._looked_normals, normals])

    def are_open(self, places_m: Array, apart_m: Array) -> NDArray[np.bool_]:
        """Whether a tap has met nothing near places of the top, (n, 3), and nearer than any contact is, shape (n,).

        Args:
            places_m: see above.
            apart_m: from there to the nearest contact, shape (n,).
        """
        return np.asarray(to_nearest_m(places_m, self._missed_m) < np.minimum(_OPEN_m, apart_m))

    def widest(self, around_m: Array) -> tuple[Array, float] | None:
        """The middle of what is open, world x, y, and how far from it the nearest contact is; None where no tap has
        missed the top, or contacts, world x, y, shape (n, 2), are not all around.
        """
        if not len(self._missed_m) or not len(around_m):
            return None
        steps_m = np.arange(-_OPEN_m, _OPEN_m + _STEP_m, _STEP_m)
        grid_m = np.stack(np.meshgrid(steps_m, steps_m), -1).reshape(-1, 2)
        places_m = (self._missed_m[:, None, :2] + grid_m).reshape(-1, 2)
        rooms_m = cdist(places_m, around_m).min(axis=1)
        rooms_m[_widest_gaps_rad(places_m, around_m) > _AROUND_rad] = 0.0
        best = rooms_m.argmax()
        return (places_m[best], float(rooms_m[best])) if rooms_m[best] > 0 else None

    def apart_m(self, places_m: Array, normals: Array, points_m: Array, point_normals: Array) -> Array:
        """From places with outward normals, shape (n, 3) each, to the nearest contact, shape (m, 3) each, that faces
        alike, or where one was expected inside, shape (n,).
        """
        apart_m = cdist(places_m, np.vstack([points_m, self._looked_m]))
        apart_m[normals @ np.vstack([point_normals, self._looked_normals]).T < _ALIKE] = np.inf
        return np.asarray(apart_m.min(axis=1, initial=np.inf))


def _widest_gaps_rad(places_m: Array, around_m: Array) -> Array:
    """Between the directions in which others are seen from places, shapes (n, 2), (m, 2), (n,)."""
    away_m = around_m - places_m[:, None]
    angles_rad = np.sort(np.arctan2(away_m[..., 1], away_m[..., 0]), axis=1)
    return np.asarray(np.diff(angles_rad, axis=1, append=angles_rad[:, :1] + 2 * np.pi).max(axis=1))
