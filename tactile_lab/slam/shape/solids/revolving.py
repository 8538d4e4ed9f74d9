"""Turns a section through a vertical axis into the surface of a solid of revolution."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.solids.mesh import FacetMesh, Indices
from tactile_lab.slam.shape.surfaces.surface import Contour

_ON_AXIS_m = 1e-9
_SHARP_rad = 0.5
_LEAST_SECTIONS, _LEAST_STEPS = 12, 4


def generatrix(section: Contour, floor_m: float, step_m: float) -> tuple[Array, Array]:
    """The line that sweeps the surface: one half of a section, above the table.

    Args:
        section: symmetric to the axis, coordinates (distance from the axis, height); or only one of two such parts.
        floor_m: height of the table.
        step_m: distance of the line's points.

    Returns:
        Points with distances from zero, shape (n, 2), and their sigma, shape (n,). The line leads from axis to axis
        with the solid on its left; it is closed, the first point again at the end, if the solid has a hole.

    Raises:
        ShapeError: nothing of it is above the table.
    """
    rows = np.column_stack([section.points_m, section.sigma_m])
    if rows[:, 0].max() < -rows[:, 0].min():
        rows = (rows * [-1.0, 1.0, 1.0])[::-1]
    rows = _clip(_clip(rows, 1, floor_m), 0, 0.0)
    if len(rows) < 3:
        raise ShapeError("the profile encloses nothing above the table")
    on_axis = rows[:, 0] < _ON_AXIS_m
    if on_axis.any():
        first = int(np.flatnonzero(on_axis & ~np.roll(on_axis, -1))[0])
        rows = np.roll(rows, -first, axis=0)
        rows = rows[: int(np.flatnonzero(rows[1:, 0] < _ON_AXIS_m)[0]) + 2]
    else:
        rows = np.vstack([rows, rows[:1]])
    rows = _resample(rows, step_m)
    return rows[:, :2], rows[:, 2]


def revolve(line_m: Array, step_m: float) -> tuple[FacetMesh, Indices]:
    """The surface that a line of :func:`generatrix` sweeps about the axis, and the line's point of each vertex.

    Args:
        line_m: shape (n, 2).
        step_m: distance of neighbouring vertices on the largest circle.
    """
    is_closed = bool(np.allclose(line_m[0], line_m[-1]))
    line_m = line_m[:-1] if is_closed else line_m
    sections = max(_LEAST_SECTIONS, int(np.ceil(2 * np.pi * line_m[:, 0].max() / step_m)))
    sizes = np.where(line_m[:, 0] < _ON_AXIS_m, 1, sections)
    rings = np.repeat(np.arange(len(line_m)), sizes)
    starts = np.cumsum(sizes) - sizes
    angles = 2 * np.pi * (np.arange(len(rings)) - starts[rings]) / sections
    reach_m = line_m[rings, 0]
    vertices_m = np.column_stack([reach_m * np.cos(angles), reach_m * np.sin(angles), line_m[rings, 1]])
    low = starts[:, None] + np.arange(sections) % sizes[:, None]
    low, high = (low, np.roll(low, -1, axis=0)) if is_closed else (low[:-1], low[1:])
    return _triangles(vertices_m, low, high), rings


def _triangles(vertices_m: Array, low: Indices, high: Indices) -> FacetMesh:
    """Two triangles for each quadrangle between neighbouring rings, shape (rings, sections); one at the axis."""
    low_next, high_next = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    halves = np.stack([low, low_next, high_next], axis=-1), np.stack([low, high_next, high], axis=-1)
    faces = np.concatenate([half.reshape(-1, 3) for half in halves])
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    return FacetMesh(vertices_m, faces, np.zeros(len(faces), dtype=np.int64))


def _clip(rows: Array, axis: int, least: float) -> Array:
    """The part of a closed polygon where a coordinate is not below a value; further columns are interpolated."""
    kept = []
    for here, following in zip(rows, np.roll(rows, -1, axis=0), strict=True):
        if here[axis] >= least:
            kept.append(here)
        if (here[axis] >= least) != (following[axis] >= least):
            share = (least - here[axis]) / (following[axis] - here[axis])
            crossing = here + share * (following - here)
            crossing[axis] = least
            kept.append(crossing)
    return np.array(kept).reshape(-1, rows.shape[1])


def _resample(rows: Array, step_m: float) -> Array:
    """Points about a step apart along a line, and its sharp corners; further columns are interpolated."""
    steps = np.diff(rows[:, :2], axis=0)
    along = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turns = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
    corners = along[1:-1][turns > _SHARP_rad]
    wanted = np.linspace(0.0, along[-1], max(_LEAST_STEPS, int(np.ceil(along[-1] / step_m))) + 1)
    wanted = np.unique(np.concatenate([wanted, corners]))
    return np.column_stack([np.interp(wanted, along, column) for column in rows.T])
