"""The upright box around contacts: its turn by their normals, its sides by their places."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array

_STEEP = 0.7
"""Largest vertical part of the normal of a contact on a side."""

_NORMAL_SIGMA_rad, _FLAT_SIGMA_m = np.radians(8.0), 0.0025
_MOST = 4.0  # squared deviations count no more than this: corners and curved sides have other normals
_TURNS = 90


def on_sides(normals: Array) -> Array:
    """Which contacts, normals (n, 3), lie on a side of an object rather than on its top."""
    return np.asarray(np.abs(normals[:, 2]) < _STEEP)


def fit_box(points_m: Array, normals: Array) -> tuple[Pose2, Array, Array]:
    """The tightest upright box with all side contacts on or in it, turned as most of them say.

    Args:
        points_m, normals: of contacts on sides, shape (n, 3) each, n at least 1, world frame.

    Returns:
        ``world_T_box`` with its origin at the points' mean, and the box's low and high corner there, shape (2,) each.
    """
    turns = np.arange(_TURNS) * (np.pi / 2 / _TURNS) - np.pi / 4
    turn = float(turns[np.argmin([_misfit(points_m[:, :2], normals[:, :2], float(t)) for t in turns])])
    world_T_box = Pose2(float(points_m[:, 0].mean()), float(points_m[:, 1].mean()), turn)
    places = np.array([world_T_box.transformTo(point) for point in points_m[:, :2]])
    return world_T_box, places.min(axis=0), places.max(axis=0)


def _misfit(points_m: Array, normals: Array, turn: float) -> float:
    """Of normals to the four sides of a box so turned, and of the places on one side to one another."""
    angles = np.arctan2(normals[:, 1], normals[:, 0]) - turn
    quarters = np.round(angles / (np.pi / 2))
    off = (angles - quarters * (np.pi / 2)) / _NORMAL_SIGMA_rad
    cost = float(np.minimum(off**2, _MOST).sum())
    faces = quarters.astype(int) % 4
    for face in np.unique(faces):
        direction = turn + face * np.pi / 2
        depth_m = points_m[faces == face] @ np.array([np.cos(direction), np.sin(direction)])
        cost += float(np.minimum(((depth_m - np.median(depth_m)) / _FLAT_SIGMA_m) ** 2, _MOST).sum())
    return cost
