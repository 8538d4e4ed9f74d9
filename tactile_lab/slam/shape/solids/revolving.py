"""Sections of solids of revolution: what is known of their foot, and the surface that they sweep."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.floating import UPRIGHT_SINE
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.solids.axis import SIDEWAYS
from tactile_lab.slam.shape.solids.mesh import FacetMesh, Indices
from tactile_lab.slam.shape.surfaces.surface import Contour

_ON_AXIS_m = 1e-9
_SHARP_rad = 0.5
_LEAST_SECTIONS, _LEAST_STEPS = 12, 4
_FOOT_SHARE, _INSET_SLOPE, _LARGEST_INSET_m = 0.35, 0.2, 0.006
"""As for the standing field: how much of the height is mirrored at the table, and how far inward its walls move."""
_WIDENS, _LOWEST = 0.6, 5
"""By how much at most a foot widens as it goes down, and so many contacts tell where, and whether they lean more."""
_DEPTHS, _BEYOND_m = 6, np.arange(0.004, 0.08, 0.004)
"""Of places beside the foot: how many one below the other, and how far out."""
_SURE_SIGMAS = 2.0
"""Walls continue below the table at their own inclination only if it differs from upright by this many sigmas."""


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


def both_halves(half: Gpis, floor_m: float | None) -> Gpis:
    """The field of the section on both sides of the axis, its foot continued below the table if there is one."""
    seen = half.observations
    rows = np.column_stack([half.contacts_m, half.normals, seen.value_sigma_m, seen.gradient_sigma])
    right = rows if floor_m is None else np.vstack([rows, *_below_table(rows, floor_m)])
    both = np.vstack([right, right * [-1, 1, -1, 1, 1, 1]])
    return half.refit(both[:, :2], both[:, 2:4], both[:, 4], both[:, 5], half.noise_scale)


def _below_table(rows: Array, floor_m: float) -> tuple[Array, Array]:
    """Virtual contacts that continue walls and bottom below the table, and walls again where they meet it.

    Walls continue at their inclination, slightly inward, as those of the standing field. What faces up is mirrored, as
    the inside of a cup's bottom, which would have no thickness otherwise.

    Args:
        rows: of each contact place, normal and their two standard deviations, shape (n, 6).
        floor_m: height of the table.

    Returns:
        Rows of the same kind. Where walls meet the table they are together as uncertain as a wall is that leans by
        :data:`_INSET_SLOPE` between its contacts and there.
    """
    above_m = rows[:, 1] - floor_m
    feet = np.flatnonzero((rows[:, 3] > -UPRIGHT_SINE) & (above_m < _FOOT_SHARE * above_m.max()))
    near, above_m = rows[feet], above_m[feet]
    is_wall = near[:, 3] < UPRIGHT_SINE
    overhang = _overhang(near[is_wall, 2:4], near[is_wall, 5]) * is_wall
    inset_m = np.minimum(_INSET_SLOPE * np.abs(above_m), _LARGEST_INSET_m) * is_wall
    below = near.copy()
    below[:, :2] = (near[:, :2] - inset_m[:, None] * near[:, 2:4]) * [1, -1] + [0, 2 * floor_m]
    below[:, 0] -= 2 * overhang * above_m
    below[:, 3] = -near[:, 3] - 2 * overhang * np.sign(near[:, 2])
    below[:, 2:4] = _unit(below[:, 2:4])
    at_table = (near + below)[is_wall] / 2
    at_table[:, 2:4] = _unit(at_table[:, 2:4])
    vague = _INSET_SLOPE * np.sqrt(max(len(at_table), 1))
    at_table[:, 4:] = np.hypot(at_table[:, 4:], vague * np.column_stack([above_m[is_wall], np.ones(len(at_table))]))
    return below, at_table


def beside_foot(half: Gpis, floor_m: float) -> Array:
    """Places between the lowest contacts of outer walls and the table that a foot does not reach, shape (q, 2).

    Below them a wall goes outward by no more than a share of how far it goes down, or as it leans. A field alone may
    spread out over the table, where it is its own mirror image.
    """
    walls = np.flatnonzero(half.normals[:, 0] > SIDEWAYS)
    lowest = walls[np.argsort(half.contacts_m[walls, 1])[:_LOWEST]]
    if len(lowest) == 0:
        return np.empty((0, 2))
    lean = half.normals[lowest].mean(axis=0)
    (edge_m, _), low_m = half.contacts_m[lowest].max(axis=0), half.contacts_m[lowest, 1].min()
    depths_m = np.linspace(0.0, max(low_m - floor_m, 0.0), _DEPTHS)
    down_m, beyond_m = (each.ravel() for each in np.meshgrid(depths_m, _BEYOND_m))
    return np.column_stack([edge_m + max(_WIDENS, lean[1] / lean[0]) * down_m + beyond_m, low_m - down_m])


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _overhang(walls: Array, sigma_rad: Array) -> float:
    """Sine of the angle by which outer walls with these normals, shape (n, 2), face the table; zero if they may be
    upright or stand on a wider foot.
    """
    outer = walls[:, 0] > SIDEWAYS
    if not outer.any():
        return 0.0
    weights = sigma_rad[outer] ** -2
    down = -float(np.average(walls[outer, 1], weights=weights))
    return down if down > _SURE_SIGMAS / np.sqrt(weights.sum()) else 0.0
