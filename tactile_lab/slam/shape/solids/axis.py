"""The axis that a solid of revolution turns about, and contacts as they are seen from it."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.solids.planes import WeightedContacts

_LEAST_WALL_CONTACTS = 12
LARGEST_GAP_rad = float(np.deg2rad(150.0))
"""Contacts on the walls must surround the axis: a smaller part of a circle may also belong to another shape."""
SIDEWAYS = 0.5
"""A contact tells about the axis if its unit normal's horizontal part is longer than this."""
_ROUNDS, _OUTLYING_SIGMAS = 8, 4.0


def find_axis(contacts: WeightedContacts, largest_gap_rad: float = LARGEST_GAP_rad) -> tuple[Array, float]:
    """The point next to the walls' normals, seen from above, and its standard deviation, by robust least squares.

    Args:
        contacts: in space, the axis along z.
        largest_gap_rad: largest angle at the axis between neighbouring contacts.

    Raises:
        ShapeError: the contacts do not surround it.
    """
    walls = np.flatnonzero(np.linalg.norm(contacts.normals[:, :2], axis=1) > SIDEWAYS)
    if len(walls) < _LEAST_WALL_CONTACTS:
        raise ShapeError(f"{len(walls)} contacts on walls are too few for an axis")
    points_m, normals = contacts.points_m[walls, :2], contacts.normals[walls, :2]
    across = np.column_stack([-normals[:, 1], normals[:, 0]])
    offsets_m, weights = np.sum(across * points_m, axis=1), np.ones(len(walls))
    for _ in range(_ROUNDS):
        axis_m = np.linalg.lstsq(np.sqrt(weights)[:, None] * across, np.sqrt(weights) * offsets_m, rcond=None)[0]
        reach_m = np.linalg.norm(points_m - axis_m, axis=1)
        variance = 1 / contacts.point_weights[walls] + reach_m**2 / contacts.normal_weights[walls]
        misses = (offsets_m - across @ axis_m) ** 2 / variance
        weights = np.maximum(1 - misses / _OUTLYING_SIGMAS**2, 0.0) ** 2 / variance
    if _largest_gap_rad((points_m - axis_m)[weights > 0]) > largest_gap_rad:
        raise ShapeError("the contacts do not surround an axis")
    try:
        covariance = np.linalg.inv((weights[:, None] * across).T @ across)
    except np.linalg.LinAlgError:  # their normals are all parallel
        raise ShapeError("the contacts determine no axis") from None
    return axis_m, float(np.sqrt(np.diag(covariance).max()))


def _largest_gap_rad(arms_m: Array) -> float:
    """Largest angle between neighbouring directions of vectors, shape (n, 2)."""
    if len(arms_m) < _LEAST_WALL_CONTACTS:
        return 2 * np.pi
    angles = np.sort(np.arctan2(arms_m[:, 1], arms_m[:, 0]))
    return float(np.diff(angles, append=angles[0] + 2 * np.pi).max())


def to_profile(points_m: Array, axis_m: Array) -> Array:
    """Places of shape (q, 3) as (distance from the axis, height), shape (q, 2)."""
    return np.column_stack([np.linalg.norm(points_m[:, :2] - axis_m, axis=1), points_m[:, 2]])


def split(contacts: WeightedContacts, axis_m: Array) -> tuple[Array, Array]:
    """The contacts' normals within the planes through the axis, shape (n, 2), and across these planes, shape (n,)."""
    arms_m = contacts.points_m[:, :2] - axis_m
    out = arms_m / np.maximum(np.linalg.norm(arms_m, axis=1, keepdims=True), 1e-9)
    level = contacts.normals[:, :2]
    within = np.column_stack([np.sum(level * out, axis=1), contacts.normals[:, 2]])
    return within, level[:, 1] * out[:, 0] - level[:, 0] * out[:, 1]


def misfit_around(contacts: WeightedContacts, axis_m: Array) -> tuple[float, float]:
    """Mean square, in variances, and log density of what the normals have across the planes through the axis."""
    squares, variance = squares_around(contacts, axis_m)
    return float(squares.mean()), float(-0.5 * np.sum(squares + np.log(2 * np.pi * variance)))


def squares_around(contacts: WeightedContacts, axis_m: Array) -> tuple[Array, Array]:
    """Of each contact the square, in variances, of what its normal has across the plane through the axis, and that
    variance, shape (n,) each.

    An error of the point along the circle turns the plane that the normal is compared with.
    """
    within, across = split(contacts, axis_m)
    reach_m = np.linalg.norm(contacts.points_m[:, :2] - axis_m, axis=1)
    turn = within[:, 0] / np.maximum(reach_m, contacts.point_weights**-0.5)
    variance = 1 / contacts.normal_weights + turn**2 / contacts.point_weights
    return across**2 / variance, variance
