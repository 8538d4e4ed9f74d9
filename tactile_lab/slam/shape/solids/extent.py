"""Bounds a solid by the field's extent on sides without a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.planes import Planes

_LEAST_COSINE_UP, _LEAST_COSINE_ASIDE = 0.5, 0.3
"""A side is open if no plane's normal has at least this component in the side's direction."""
_LEVEL_COSINE = np.cos(np.deg2rad(30.0))
_SPACING_m, _MARGIN_m = 0.007, 0.030
_LEAST_SIGMA_m = 0.003
_BISECTIONS = 12
_FLATTEST_SLOPE = 0.1


@dataclass(frozen=True)
class Cap:
    """A plane at the end of the field, on an untouched side.

    Attributes:
        normal: outward, shape (3,).
        foot_m: the point of the field's surface farthest in this direction, shape (3,).
        offset_m: ``normal . foot``.
        sigma_m: standard deviation of the offset, from the field.
    """

    normal: Array
    foot_m: Array
    offset_m: float
    sigma_m: float


def open_sides(gpis: Gpis, planes: Planes, floor_m: float | None) -> tuple[Cap, ...]:
    """Caps for the sides that no plane bounds; a floor bounds the lower side. Empty if the field has no inside."""
    sides = [side for side, least in _sides(planes, floor_m) if _towards(planes, side) < least]
    if not sides:
        return ()
    inside_m = _inside(gpis)
    return tuple(_cap(gpis, side, inside_m) for side in sides) if len(inside_m) else ()


def field_end(gpis: Gpis, side: Array) -> Cap:
    """Where the field's inside ends in a direction, given as unit vector of shape (3,).

    Raises:
        ShapeError: it has no inside near the contacts.
    """
    inside_m = _inside(gpis)
    if len(inside_m) == 0:
        raise ShapeError("the field has no inside near the contacts", hint="More contacts are needed")
    return _cap(gpis, side, inside_m)


def _inside(gpis: Gpis) -> Array:
    """Points of a coarse grid that are inside, shape (k, 3)."""
    contacts = gpis.contacts_m
    grid = FieldGrid.tabulate(gpis, contacts.min(axis=0) - _MARGIN_m, contacts.max(axis=0) + _MARGIN_m, _SPACING_m)
    return np.asarray(grid.lower_m + _SPACING_m * np.argwhere(grid.values_m < 0))


def _towards(planes: Planes, side: Array) -> float:
    """Largest component in a side's direction of the normals of planes that can end the solid there: a slope that is
    hardly steeper than a top comes down to the table far outside.
    """
    level = np.abs(planes.normals[:, 2]) > _LEVEL_COSINE
    return float(np.where(level & (side[2] == 0), -1.0, planes.normals @ side).max())


def _sides(planes: Planes, floor_m: float | None) -> list[tuple[Array, float]]:
    """Up, down unless there is a floor, and four sides along the wall of most contacts."""
    up = np.array([0.0, 0.0, 1.0])
    level = planes.normals * [1.0, 1.0, 0.0]
    wall = level[int((np.linalg.norm(level, axis=1) > np.sqrt(0.5)).argmax())]
    along = wall / np.linalg.norm(wall) if np.linalg.norm(wall) > 1e-3 else np.array([1.0, 0.0, 0.0])
    across = np.cross(up, along)
    ends = [(up, _LEAST_COSINE_UP)] + ([(-up, _LEAST_COSINE_UP)] if floor_m is None else [])
    return ends + [(side, _LEAST_COSINE_ASIDE) for side in (along, -along, across, -across)]


def _cap(gpis: Gpis, side: Array, inside_m: Array) -> Cap:
    start_m = inside_m[int((inside_m @ side).argmax())]
    near, far = 0.0, 2 * _SPACING_m
    for _ in range(_BISECTIONS):
        middle = (near + far) / 2
        inside = gpis.mean(start_m[None] + middle * side)[0] < 0
        near, far = (middle, far) if inside else (near, middle)
    foot = start_m + near * side
    found = gpis.predict(foot[None], gradient=True, variance=True)
    slope = max(float(np.linalg.norm(found.gradient[0])), _FLATTEST_SLOPE)
    sigma_m = max(float(np.sqrt(found.variance_m2[0])) / slope, _LEAST_SIGMA_m)
    return Cap(side, foot, float(side @ foot), sigma_m)
