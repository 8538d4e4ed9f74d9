"""Turns of an estimated shape about a vertical axis that leave it as it is, so that no contact can tell them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.sampling import sample_mesh_with_normals, sample_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

ROUND = 0
"""The order of a shape that every turn leaves as it is."""

INTERCHANGEABLE = 6
"""From this order on a turn is within the slips of one step: the heading is known up to such turns only."""

_MOST = 12
_SOME_TURNS_rad = np.deg2rad([7.0, 20.0, 45.0, 77.0, 131.0])
ALIKE_m = 0.001
"""Resolution of a fingertip."""

NEARLY_ALIKE_m = 0.004
"""Shapes this similar after a turn are distinguished by many contacts only: a trajectory may have mistaken the turn."""

_STEP_m = 0.001
_SAMPLES = 4000
_LEVER_m = 0.050


@dataclass(frozen=True)
class Symmetry:
    """Turns that leave a shape as it is.

    Attributes:
        order: number of these turns in a full one, from 2 on; :data:`ROUND` for any.
        centre_m: the axis, object frame, shape (2,).
    """

    order: int
    centre_m: Array

    @property
    def interchangeable(self) -> bool:
        """Whether a turn is as small as a slip, so that the heading cannot be followed."""
        return self.order == ROUND or self.order >= INTERCHANGEABLE

    @property
    def words(self) -> str:
        """The consequence, as a sentence."""
        if self.order == ROUND:
            return "the object is round: contacts cannot determine its rotation about its axis"
        return f"the object looks the same after a turn of {360 / self.order:.0f}°: its heading may be off by it"

    def offset(self, turns: int) -> Array:
        """The object frame turned about the axis so many times, in the present one: (x m, y m, yaw rad)."""
        turn_rad = 2 * np.pi * turns / max(self.order, 1)
        return np.append(self.centre_m - _rotation(turn_rad) @ self.centre_m, turn_rad)

    def explains(self, offset: Array, tolerance_m: float) -> bool:
        """Whether a displacement of the object frame, (x m, y m, yaw rad), is one of these turns.

        Args:
            offset: the other object frame in the present one.
            tolerance_m: of the axis, and of what is left of the turn at 50 mm from it.
        """
        moved = _rotation(float(offset[2])) @ self.centre_m + offset[:2] - self.centre_m
        left_rad = 0.0
        if self.order != ROUND:
            step_rad = 2 * np.pi / self.order
            left_rad = abs(offset[2] - step_rad * round(float(offset[2]) / step_rad))
        return bool(np.linalg.norm(moved) < tolerance_m and left_rad < tolerance_m / _LEVER_m)


def symmetry_of(shape: Contour | SurfaceMesh, alike_m: float = ALIKE_m) -> Symmetry | None:
    """The symmetry of an outline, or of a surface about a vertical axis; None if it has none.

    Args:
        shape: object frame.
        alike_m: root mean square distance up to which the turned shape counts as the same.
    """
    points, normals = _samples(shape)
    centre = points.mean(axis=0)[:2]
    tree = cKDTree(points)

    def stays(turn_rad: float) -> bool:
        turned = points.copy()
        turned[:, :2] = (points[:, :2] - centre) @ _rotation(turn_rad).T + centre
        _, nearest = tree.query(turned)
        away = np.sum((turned - points[nearest]) * normals[nearest], axis=1)
        return bool(np.mean(away**2) < alike_m**2)

    if all(map(stays, _SOME_TURNS_rad)):
        return Symmetry(ROUND, centre)
    order = largest_order(stays)
    return None if order is None else Symmetry(order, centre)


def largest_order(stays: Callable[[float], bool], fewest: int = 2) -> int | None:
    """The largest number of equal turns that each leave a shape as it is; None if there are not so many as the fewest.

    All of them are tried: an octagon looks nearly the same after one ninth of a turn, and not after two.

    Args:
        stays: whether the shape is the same after a turn (rad).
        fewest: orders from here on count.
    """
    for order in range(_MOST, fewest - 1, -1):
        if all(stays(2 * np.pi * turns / order) for turns in range(1, order // 2 + 1)):
            return order
    return None


def _samples(shape: Contour | SurfaceMesh) -> tuple[Array, Array]:
    """Points spread over a shape with their normals."""
    if isinstance(shape, SurfaceMesh):
        return sample_mesh_with_normals(shape, _SAMPLES)
    points = sample_polygon(shape.points_m, _STEP_m)
    tangents = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    normals = np.column_stack([tangents[:, 1], -tangents[:, 0]])
    return points, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _rotation(turn_rad: float) -> Array:
    return np.array([[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]])
