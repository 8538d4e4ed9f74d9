"""Prior means of the surface field (section 2.2.3), which apply where nothing has been touched.

All are positive outside and zero on the assumed surface, with a slope of about one there, since our fields are
distances. The thesis leaves the factor h of (2.19) open and does not say how the primitive's pose and size are found;
here h makes the slope at the contacts one on average, and pose and size come from the contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from drivers.core.contacts import Array

_RADIUS_BOUNDS_m = (0.005, 0.200)
_RADIUS_SHARE = 0.1
"""Weight of a guessed radius relative to the contacts: it matters only if they do not determine the radius."""
_ROUNDNESS_SHARE = 0.01
"""Weight of the sphere relative to the contacts for the ellipsoid's curvatures, which contacts may not determine."""
_SLOPE_ROUNDS = 4
_LARGEST_AXES_RATIO = 4.0
"""Largest ratio of each of the ellipsoid's semi-axes to the sphere's radius, in either direction."""


class PriorMean(Protocol):
    """A differentiable function of space, metres, positive outside the object."""

    def value(self, points_m: Array) -> Array:
        """Values, shape (n,)."""

    def gradient(self, points_m: Array) -> Array:
        """Gradients, shape (n, d)."""


class ZeroMean:
    """The thesis's default, (2.13): untouched space is assumed to lie on the surface."""

    def value(self, points_m: Array) -> Array:
        return np.zeros(len(points_m))

    def gradient(self, points_m: Array) -> Array:
        return np.zeros_like(points_m)


@dataclass(frozen=True)
class OutwardMean:
    """Untouched space is assumed to be outside, increasingly with the distance from the data.

    ``sqrt(|x - centre|^2 + softness^2)``: a cone with a rounded tip, positive everywhere and of slope one far
    out like a distance, in place of the quadratic of (2.19), whose slope grows without bound.

    Attributes:
        centre_m: shape (d,), the middle of the data.
        softness_m: radius of the rounded tip, and the smallest value.
    """

    centre_m: Array
    softness_m: float

    @classmethod
    def around(cls, points_m: Array, softness_m: float) -> Self:
        """The prior for contacts of shape (n, d): centred between their extremes."""
        centre = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
        return cls(centre, softness_m)

    def value(self, points_m: Array) -> Array:
        squared = np.sum((points_m - self.centre_m) ** 2, axis=1)
        return np.asarray(np.sqrt(squared + self.softness_m**2))

    def gradient(self, points_m: Array) -> Array:
        return np.asarray((points_m - self.centre_m) / self.value(points_m)[:, None])


@dataclass(frozen=True)
class EllipsoidMean:
    """Equation 2.19, ``h/2 ((x - mu)^T A (x - mu) - 1)``: a quadratic that is zero on an ellipsoid (or an ellipse).

    Attributes:
        centre_m: mu, shape (d,).
        matrix: A of (2.20), shape (d, d), per square metre.
        factor_m: h.
    """

    centre_m: Array
    matrix: Array
    factor_m: float

    @classmethod
    def sphere_around(cls, points_m: Array, normals: Array) -> Self:
        """The sphere (circle) whose points with the contacts' normals are nearest to the contacts, by least squares.

        If the contacts do not determine its radius, as those on one flat face, half their spread is used.
        """
        centre, radius = _sphere(points_m, normals)
        return cls(centre, np.eye(len(centre)) / radius**2, radius)

    @classmethod
    def ellipsoid_around(cls, points_m: Array, normals: Array) -> Self:
        """The ellipsoid (ellipse) whose quadratic is zero at the contacts with the normals as gradients.

        Linear least squares in the quadratic's coefficients, regularized towards the sphere.
        """
        centre, radius = _sphere(points_m, normals)
        curvature, linear, constant = _quadratic((points_m - centre) / radius, normals)
        values, axes = np.linalg.eigh(curvature)
        values = np.clip(values, 1 / _LARGEST_AXES_RATIO, _LARGEST_AXES_RATIO)
        curvature = (axes * values) @ axes.T
        middle = np.clip(-np.linalg.solve(curvature, linear), -1.0, 1.0)
        level = max(float(middle @ curvature @ middle) - 2 * constant, 0.1)
        matrix = (axes * np.clip(values / level, _LARGEST_AXES_RATIO**-2, _LARGEST_AXES_RATIO**2)) @ axes.T
        at_contacts = (points_m - centre) / radius - middle
        slope = float(np.linalg.norm(at_contacts @ matrix, axis=1).mean())
        return cls(centre + radius * middle, matrix / radius**2, radius / max(slope, 0.1))

    def value(self, points_m: Array) -> Array:
        offset = points_m - self.centre_m
        return np.asarray(0.5 * self.factor_m * (np.einsum("ni,ij,nj->n", offset, self.matrix, offset) - 1))

    def gradient(self, points_m: Array) -> Array:
        return np.asarray(self.factor_m * (points_m - self.centre_m) @ self.matrix)


def _sphere(points_m: Array, normals: Array) -> tuple[Array, float]:
    """Centre and radius that minimise ``sum |x - centre - radius n|^2`` with a guess of the radius among the data."""
    guess = float(np.clip(np.ptp(points_m, axis=0).max() / 2, *_RADIUS_BOUNDS_m))
    points, ways = points_m - points_m.mean(axis=0), normals - normals.mean(axis=0)
    radius = (np.sum(points * ways) + _RADIUS_SHARE * guess) / (np.sum(ways**2) + _RADIUS_SHARE)
    radius = float(np.clip(radius, *_RADIUS_BOUNDS_m))
    return points_m.mean(axis=0) - radius * normals.mean(axis=0), radius


def _quadratic(points: Array, normals: Array) -> tuple[Array, Array, float]:
    """B, b and c of ``x^T B x / 2 + b^T x + c`` with zeros at the points and their normals as gradients.

    Only the directions of gradients are data: their lengths, one on average, are those of the quadratic found before. A
    unit sphere is added to the data of the n points, with the weight ``_ROUNDNESS_SHARE * n``.
    """
    count, dimension = points.shape
    first, second = np.triu_indices(dimension)
    product = points[:, first] * points[:, second] * np.where(first == second, 0.5, 1.0)
    rows = [np.column_stack([product, points, np.ones(count)])]
    for axis in range(dimension):
        by_axis = (first == axis) * points[:, second] + ((second == axis) & (first != second)) * points[:, first]
        unit = np.tile(np.eye(dimension)[axis], (count, 1))
        rows.append(np.column_stack([by_axis, unit, np.zeros(count)]))
    unknowns = rows[0].shape[1]
    sphere = np.concatenate([(first == second).astype(float), np.zeros(dimension), [-0.5]])
    weight = np.sqrt(_ROUNDNESS_SHARE * count)
    matrix = np.vstack([*rows, weight * np.eye(unknowns)])
    slopes = np.ones(count)
    for _ in range(_SLOPE_ROUNDS):
        target = np.concatenate([np.zeros(count), (slopes[:, None] * normals).T.ravel(), weight * sphere])
        found = np.linalg.lstsq(matrix, target, rcond=None)[0]
        gradients = (matrix[count : (dimension + 1) * count] @ found).reshape(dimension, count).T
        slopes = np.clip(np.sum(gradients * normals, axis=1), 0.3, 3.0)
        slopes = slopes / slopes.mean()
    curvature = np.zeros((dimension, dimension))
    curvature[first, second] = curvature[second, first] = found[: len(first)]
    return curvature, found[len(first) : -1], float(found[-1])
