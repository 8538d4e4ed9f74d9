"""Continues a field down to the table that its object stands on, where it ends above it."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.known_places import DEPTH_m, inside_at

_FLOATS_m, _SPACING_m = 0.010, 0.004
"""A field that is nowhere inside so high over the table hangs over it; spacing of the places where it is looked at."""

_LOWEST_BAND_m, _STEP_m = 0.010, 0.006
_ACROSS = (0.0, 1 / 3, 2 / 3)
"""Shares of the way from the middle of the foot to its walls."""

UPRIGHT_SINE = np.sin(np.deg2rad(20.0))
"""Largest vertical part of the normal of an upright wall."""


def standing(field: Gpis, floor_m: float) -> Gpis:
    """The field, told that walls go on to the table below its lowest contacts, if it hangs over it.

    A field closes where a hand no longer came, and an object that nobody touched in its lower third hangs in the air.
    Places as far inside as a told place is uncertain are told, one below the other, and across the foot.

    Args:
        field: in space or of a section, its last coordinate the height; normals are observed.
        floor_m: height of the table.
    """
    if not _floats(field, floor_m):
        return field
    heights_m, normals = field.contacts_m[:, -1], field.normals
    walls = np.flatnonzero((np.abs(normals[:, -1]) < UPRIGHT_SINE) & (heights_m > floor_m))
    if not len(walls):
        return field
    lowest_m = float(heights_m[walls].min())
    feet = walls[heights_m[walls] < lowest_m + _LOWEST_BAND_m]
    inside_m = field.contacts_m[feet, :-1] - DEPTH_m * normals[feet, :-1]
    levels_m = np.arange(floor_m, lowest_m, _STEP_m)
    below_m = np.column_stack([np.tile(inside_m, (len(levels_m), 1)), np.repeat(levels_m, len(feet))])
    middle_m = inside_m.mean(axis=0)
    across_m = np.vstack([middle_m + share * (inside_m - middle_m) for share in _ACROSS])
    return inside_at(field, np.vstack([below_m, np.column_stack([across_m, np.full(len(across_m), floor_m)])]))


def _floats(field: Gpis, floor_m: float) -> bool:
    return bool(field.mean(_level(field.contacts_m[:, :-1], floor_m + _FLOATS_m)).min() > 0)


def _level(places_m: Array, height_m: float) -> Array:
    """Places at one height above or below the contacts' places, shape (n, d - 1); shape (q, d)."""
    ends_m = zip(places_m.min(axis=0), places_m.max(axis=0), strict=True)
    sides_m = [np.arange(low, high + _SPACING_m, _SPACING_m) for low, high in ends_m]
    over_m = np.stack(np.meshgrid(*sides_m), axis=-1).reshape(-1, len(sides_m))
    return np.column_stack([over_m, np.full(len(over_m), height_m)])
