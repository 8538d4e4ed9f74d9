"""Continues a field down to the table that its object stands on, where it ends above it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.known_places import inside_at, wall_at

_FLOATS_m, _SPACING_m = 0.010, 0.004
"""A field that is nowhere inside so high over the table hangs over it; spacing of the places where it is looked at."""

_LOWEST_BAND_m, _STEP_m = 0.010, 0.006
_ACROSS = (0.0, 1 / 3, 2 / 3)
"""Shares of the way from the middle of the foot to its walls."""

UPRIGHT_SINE = np.sin(np.deg2rad(20.0))
"""Largest vertical part of the normal of an upright wall."""

_SIGMA_SLOPE = 0.2
"""Standard deviation of a wall below its lowest contacts, as a share of the height between."""

_STEEPEST = 0.8
"""Largest downward part of the normal of a wall that leans outward, as that of a bowl."""

_SURE_SIGMAS, _LARGEST_SHARE_IN = 2.0, 2 / 3
"""Walls go on inward at their own inclination if it differs from upright by so many sigmas, up to this share of the way
to the middle.
"""


def standing(field: Gpis, floor_m: float) -> Gpis:
    """The field, told that walls go on to the table below its lowest contacts, if it hangs over it.

    A field closes where a hand no longer came, and an object that nobody touched in its lower third hangs in the air.
    Walls that go on below the lowest contacts are told, at their inclination if that is outward, and what is inside the
    foot.

    Args:
        field: in space or of a section, its last coordinate the height; normals are observed.
        floor_m: height of the table.
    """
    if not _floats(field, floor_m):
        return field
    heights_m, down = field.contacts_m[:, -1], -field.normals[:, -1]
    walls = np.flatnonzero((down > -UPRIGHT_SINE) & (down < _STEEPEST) & (heights_m > floor_m))
    if not len(walls):
        return field
    lowest_m = float(heights_m[walls].min())
    feet = walls[heights_m[walls] < lowest_m + _LOWEST_BAND_m]
    foot = _Foot.of(field, feet)
    told = field
    for level_m in np.arange(floor_m, lowest_m, _STEP_m):
        told = wall_at(told, foot.at(level_m), foot.outward, _SIGMA_SLOPE * (foot.heights_m - level_m))
    at_table_m = foot.at(floor_m)[:, :-1]
    across_m = np.vstack([foot.middle_m + share * (at_table_m - foot.middle_m) for share in _ACROSS])
    return inside_at(told, np.column_stack([across_m, np.full(len(across_m), floor_m)]))


@dataclass(frozen=True)
class _Foot:
    """Walls below their lowest contacts.

    Attributes:
        middle_m: between them, seen from above, shape (d - 1,).
        aside_m: the contacts, seen from above, shape (n, d - 1).
        heights_m: theirs, shape (n,).
        outward: horizontal unit vectors across the walls, shape (n, d).
        inclination: how far the walls go inward per height.
    """

    middle_m: Array
    aside_m: Array
    heights_m: Array
    outward: Array
    inclination: float

    @classmethod
    def of(cls, field: Gpis, feet: NDArray[np.intp]) -> Self:
        """Of a field's contacts with these indices."""
        aside_m, level = (
            field.contacts_m[feet, :-1],
            field.normals[feet] * ([1.0] * (field.contacts_m.shape[1] - 1) + [0.0]),
        )
        level /= np.linalg.norm(level, axis=1, keepdims=True)
        middle_m = aside_m.mean(axis=0)
        outer = feet[np.einsum("nk,nk->n", aside_m - middle_m, level[:, :-1]) > 0]
        return cls(middle_m, aside_m, field.contacts_m[feet, -1], level, _inclination(field, outer))

    def at(self, level_m: float) -> Array:
        """Places on the walls at a height, shape (n, d)."""
        out_m = np.einsum("nk,nk->n", self.aside_m - self.middle_m, self.outward[:, :-1])
        in_m = self.inclination * np.maximum(self.heights_m - level_m, 0.0)
        in_m = np.minimum(in_m, _LARGEST_SHARE_IN * np.maximum(out_m, 0.0))
        places_m = self.aside_m - in_m[:, None] * self.outward[:, :-1]
        return np.column_stack([places_m, np.full(len(places_m), level_m)])


def _inclination(field: Gpis, feet: NDArray[np.intp]) -> float:
    """How far walls with these contacts go inward per height; zero if they may be upright or stand on a wider foot."""
    if not len(feet):
        return 0.0
    weights = field.observations.gradient_sigma[feet] ** -2
    down = -float(np.average(field.normals[feet, -1], weights=weights))
    return down / np.sqrt(1 - down**2) if down > _SURE_SIGMAS / np.sqrt(weights.sum()) else 0.0


def _floats(field: Gpis, floor_m: float) -> bool:
    return bool(field.mean(_level(field.contacts_m[:, :-1], floor_m + _FLOATS_m)).min() > 0)


def _level(places_m: Array, height_m: float) -> Array:
    """Places at one height above or below the contacts' places, shape (n, d - 1); shape (q, d)."""
    ends_m = zip(places_m.min(axis=0), places_m.max(axis=0), strict=True)
    sides_m = [np.arange(low, high + _SPACING_m, _SPACING_m) for low, high in ends_m]
    over_m = np.stack(np.meshgrid(*sides_m), axis=-1).reshape(-1, len(sides_m))
    return np.column_stack([over_m, np.full(len(over_m), height_m)])
