"""Interpolation of calibration tables, forward and inverse: curves of one variable and maps of the plane.

Nothing here knows units: the calibration of the joints puts counts in and takes degrees out, or the reverse.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from drivers.core.contacts import Array

_RING_POINTS = 10
_RING_SPREAD = 2.0
_FLAT = 1e-6
_INSIDE = -1e-9


class Curves:
    """Many piecewise linear curves, evaluated together and continued beyond both ends with the end pair.

    Args:
        tables: points (x, y) of each curve, shape (n, 2) with n of two or more, x rising strictly; y rises or falls
            strictly, or is constant. The inverse of a constant curve is the mean of its x.
    """

    def __init__(self, tables: Sequence[Array]) -> None:
        self._forward = _Segments([(table[:, 0], table[:, 1]) for table in tables])
        self._inverse = _Segments([_swap(table) for table in tables])

    def __call__(self, x: Array) -> Array:
        """Value of each curve at its own x, shapes (curves,)."""
        return self._forward(x)

    def inverse(self, y: Array) -> Array:
        """The x at which each curve has its own y, shapes (curves,)."""
        return self._inverse(y)


class Plane:
    """A map of the plane from scattered points: linear on the triangles of their Delaunay triangulation.

    Around the table ten further points stand on a circle twice as wide, where the plane fitted to the table continues
    it; beyond them that plane holds. This is the rule of Shadow's host library.

    Args:
        source: points, shape (n, 2).
        target: what they map to, shape (n, 2).

    Raises:
        ValueError: fewer than three different points, or the map turns over somewhere.
    """

    def __init__(self, source: Array, target: Array) -> None:
        if len(source) < 3 or len(np.unique(source, axis=0)) != len(source):
            raise ValueError("needs three or more points with different counts")
        ring = _surrounding_points(source)
        fitted: Array = np.asarray(np.linalg.lstsq(_homogeneous(source), target, rcond=None)[0], dtype=np.float64)
        nodes, values = np.vstack([source, ring]), np.vstack([target, _homogeneous(ring) @ fitted])
        triangles = Delaunay(nodes).simplices.astype(np.intp)
        if _folds(nodes, values, triangles[(triangles < len(source)).all(axis=1)]):
            raise ValueError("folds over itself: some points may be swapped")
        self._forward = _TriangleMap(nodes, values, triangles, fitted)
        upright = np.abs(_doubled_areas(values, triangles)) > _FLAT
        constant = ~np.ptp(target, axis=0).astype(bool)
        self.invertible = bool(upright.any()) or bool(constant.sum() == 1)
        """Whether the target determines the source; where one coordinate is constant, on the line of the table."""
        self._inverse: _TriangleMap | _LineMap
        if upright.any():
            self._inverse = _TriangleMap(values, nodes, triangles[upright], _invert(fitted))
        elif self.invertible:
            self._inverse = _LineMap(source, target, int(constant.argmin()))

    def __call__(self, point: Array) -> Array:
        """The image of one point, shapes (2,)."""
        return self._forward(point)

    def inverse(self, point: Array) -> Array:
        """The point with this image, shapes (2,); only of an invertible map."""
        return self._inverse(point)


class _Segments:
    """Read in every cycle: bisecting two dozen short lists takes half the time of the same on arrays."""

    def __init__(self, curves: Sequence[tuple[Array, Array]]) -> None:
        self._curves = [(x[1:-1].tolist(), _lines(x, y)) for x, y in curves]

    def __call__(self, x: Array) -> Array:
        values = []
        for place, (knots, lines) in zip(x.tolist(), self._curves, strict=True):
            start_x, start_y, slope = lines[bisect_right(knots, place)]
            values.append(start_y + slope * (place - start_x))
        return np.array(values)


class _TriangleMap:
    def __init__(self, source: Array, target: Array, triangles: NDArray[np.intp], beyond: Array) -> None:
        corners = np.concatenate([source[triangles], np.ones((*triangles.shape, 1))], axis=2)
        weights = np.linalg.inv(corners.transpose(0, 2, 1)).transpose(1, 0, 2)  # corner by triangle by (x, y, 1)
        self._turn, self._shift = weights[:, :, :2].reshape(-1, 2), weights[:, :, 2].copy()
        self._targets = target[triangles]
        self._beyond = beyond

    def __call__(self, point: Array) -> Array:
        weights = self._turn.dot(point).reshape(self._shift.shape) + self._shift
        smallest = np.minimum(np.minimum(weights[0], weights[1]), weights[2])  # of three rows quicker than min(axis=0)
        triangle = smallest.argmax()
        if smallest[triangle] < _INSIDE:
            return np.asarray(point @ self._beyond[:2] + self._beyond[2])
        return np.asarray(weights[:, triangle] @ self._targets[triangle])


class _LineMap:
    """The source by one coordinate of the target, the other of which is constant."""

    def __init__(self, source: Array, target: Array, varying: int) -> None:
        order = target[:, varying].argsort()
        self._varying, self._knots, self._source = varying, target[order, varying], source[order]

    def __call__(self, point: Array) -> Array:
        return np.array([np.interp(point[self._varying], self._knots, along) for along in self._source.T])


def _lines(x: Array, y: Array) -> list[tuple[float, float, float]]:
    """Start and slope of each piece."""
    return list(zip(x[:-1].tolist(), y[:-1].tolist(), (np.diff(y) / np.diff(x)).tolist(), strict=True))


def _swap(table: Array) -> tuple[Array, Array]:
    if table[0, 1] == table[-1, 1]:
        middle = table[:, 0].mean()
        return table[0, 1] + np.array([0.0, 1.0]), np.array([middle, middle])
    rising = table if table[-1, 1] > table[0, 1] else table[::-1]
    return rising[:, 1], rising[:, 0]


def _surrounding_points(source: Array) -> Array:
    centre = source.mean(axis=0)
    radius = _RING_SPREAD * np.linalg.norm(source - centre, axis=1).max()
    angles = np.arange(_RING_POINTS) * (2 * np.pi / _RING_POINTS)
    return np.asarray(centre + radius * np.column_stack([np.cos(angles), np.sin(angles)]))


def _homogeneous(points: Array) -> Array:
    return np.column_stack([points, np.ones(len(points))])


def _invert(affine: Array) -> Array:
    linear = np.linalg.inv(affine[:2])
    return np.vstack([linear, -affine[2] @ linear])


def _doubled_areas(points: Array, triangles: NDArray[np.intp]) -> Array:
    first, second = points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def _folds(source: Array, target: Array, triangles: NDArray[np.intp]) -> bool:
    """Whether some triangles keep their orientation and others turn over."""
    turned = np.sign(_doubled_areas(source, triangles)) * _doubled_areas(target, triangles)
    return bool((turned > _FLAT).any() and (turned < -_FLAT).any())
