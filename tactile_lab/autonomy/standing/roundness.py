"""Whether what was touched all around is round or has sides, by its contacts.

Contacts on a box lie on one of four sides and have their normals; those on what is round are as far from its middle as
one another, and their normals point away from there. One on an edge, or on a handle, fits neither, and counts no more
against either than a deviation of two standard deviations.
"""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array

_NORMAL_SIGMA_rad, _PLACE_SIGMA_m, _MOST = np.radians(8.0), 0.0025, 4.0
"""Of a normal, and of a place on its side; the most that one squared deviation counts."""

_MIDDLE_SIGMA_m = 0.010
"""Of the middle of what is round beside that of the box around it."""

_SURELY = 2.0
"""So much more contacts have to speak for round than for sides, as its middle is fitted to them."""

_STEPS = 5


def is_round(points_m: Array, normals: Array, middle_m: Array, yaw_rad: float) -> bool:
    """Whether contacts on sides say so.

    Args:
        points_m, normals: horizontal parts, shape (n, 2) each, world frame.
        middle_m, yaw_rad: of the box around them, world, shape (2,).
    """
    angles = np.arctan2(normals[:, 1], normals[:, 0])
    return _as_round(points_m, angles, middle_m) + _SURELY < _as_box(points_m, angles, yaw_rad)


def _as_box(points_m: Array, angles: Array, yaw_rad: float) -> float:
    """Misfit of contacts to four sides so turned."""
    faces = np.round((angles - yaw_rad) / (np.pi / 2)) % 4
    cost = float(_of_normals(_to_nearest(angles - yaw_rad, np.pi / 2)).sum())
    for face in np.unique(faces):
        direction = yaw_rad + face * np.pi / 2
        cost += _of_places(points_m[faces == face] @ np.array([np.cos(direction), np.sin(direction)]))
    return cost


def _as_round(points_m: Array, angles: Array, middle_m: Array) -> float:
    """Misfit of contacts to what is round about the middle near ``middle_m`` from which most normals point away."""
    across, centre_m = np.stack([-np.sin(angles), np.cos(angles)], axis=1), middle_m
    for _ in range(_STEPS):
        fits = (misfits := _radially(points_m - centre_m, angles)) < _MOST
        sigma_m = _NORMAL_SIGMA_rad * np.maximum(np.linalg.norm(points_m - centre_m, axis=1), _MIDDLE_SIGMA_m)
        rows = across[fits] / sigma_m[fits, None]
        right = np.einsum("nk,nk->n", rows, points_m[fits] - middle_m)
        prior = np.eye(2) / _MIDDLE_SIGMA_m**2
        centre_m = middle_m + np.linalg.solve(rows.T @ rows + prior, rows.T @ right)
    misfits = _radially(points_m - centre_m, angles)
    return float(misfits.sum()) + _of_places(np.linalg.norm(points_m - centre_m, axis=1))


def _radially(out_m: Array, angles: Array) -> Array:
    """Misfit of each normal to the way from a middle, shape (n,)."""
    return _of_normals(_to_nearest(angles - np.arctan2(out_m[:, 1], out_m[:, 0]), 2 * np.pi))


def _of_normals(off_rad: Array) -> Array:
    return np.asarray(np.minimum((off_rad / _NORMAL_SIGMA_rad) ** 2, _MOST))


def _of_places(depth_m: Array) -> float:
    """Misfit of distances to their median."""
    return float(np.minimum(((depth_m - np.median(depth_m)) / _PLACE_SIGMA_m) ** 2, _MOST).sum())


def _to_nearest(angles: Array, period: float) -> Array:
    """From each angle to the nearest multiple of a period."""
    return np.asarray(angles - np.round(angles / period) * period)
