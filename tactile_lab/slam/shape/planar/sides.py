"""Divides contacts in the plane into straight and round sides.

A side is the zero set of ``f(x) = a |x|^2 + b . x + d``, scaled so that its gradient has length one on it: a straight
line for ``a = 0``, otherwise a circle of curvature ``2 a``, convex where it is positive. Both the distance of a contact
from the side, to first order ``f``, and its normal, the gradient, are linear in the four numbers, so that every run of
contacts has its best side by one small system of equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.runs import cheapest_division
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, price_of_face

Indices = NDArray[np.int64]

LEAST_ON_ARC = 4
"""Contacts of a round side."""

_SHARPEST_m = 0.004
"""Radius of the most curved side; of a fingertip's size nothing more can be told."""

_PRIOR_m2 = (2 * _SHARPEST_m) ** 2
"""Information about a side's curvature before any contact: none is sharper. It decides where all contacts of a run are
at one place."""

_TYPICAL_LENGTH_m = 0.030
"""Over which the normals of two contacts tell a side's curvature."""

_DIRECTION = slice(1, 4)


@dataclass(frozen=True)
class Side:
    """One side of an outline.

    Attributes:
        numbers: a (1/m), b (2), d (m), about ``origin_m``.
        covariance: of the four numbers, shape (4, 4); nothing is said of the first where the side is straight.
        origin_m: shape (2,).
        members: the contacts on it, in their order along the outline, counter-clockwise.
        chi_square: misfit of their points and normals.
    """

    numbers: Array
    covariance: Array
    origin_m: Array
    members: Indices
    chi_square: float

    @property
    def is_round(self) -> bool:
        return bool(self.numbers[0] != 0.0)

    def values_m(self, places_m: Array) -> Array:
        """Distance of places near the side, shape (q, 2), outwards, shape (q,)."""
        return np.asarray(features(places_m - self.origin_m) @ self.numbers)

    def gradients(self, places_m: Array) -> Array:
        """Outward normals at places near the side, shape (q, 2), of length one on it."""
        return np.asarray(2 * self.numbers[0] * (places_m - self.origin_m) + self.numbers[1:3])

    def feet_m(self, places_m: Array) -> Array:
        """The nearest places on the side, shape (q, 2)."""
        if not self.is_round:
            return np.asarray(places_m - self.values_m(places_m)[:, None] * self.gradients(places_m))
        outward = places_m - self.centre_m
        return np.asarray(
            self.centre_m + self.radius_m * outward / np.linalg.norm(outward, axis=1, keepdims=True).clip(1e-12)
        )

    @property
    def centre_m(self) -> Array:
        """Of a round side, shape (2,)."""
        return np.asarray(self.origin_m - self.numbers[1:3] / (2 * self.numbers[0]))

    @property
    def radius_m(self) -> float:
        """Of a round side, positive."""
        a, b, d = self.numbers[0], self.numbers[1:3], self.numbers[3]
        return float(np.sqrt(b @ b / (4 * a**2) - d / a))

    def displacements_m(self, places_m: Array) -> Array:
        """Of places on the side, shape (q, 2), outwards, by independent standard normal variables, shape (q, 4)."""
        values, vectors = np.linalg.eigh(self.covariance)
        return np.asarray(features(places_m - self.origin_m) @ (vectors * np.sqrt(values.clip(0.0))))

    def variance_m2(self, places_m: Array) -> Array:
        """Variance across the side at places on it, shape (q,)."""
        return np.asarray(np.sum(self.displacements_m(places_m) ** 2, axis=1))


def price_of_curvature(normal_sigma_rad: Array) -> float:
    """Chi-square that a round side must save over a straight one, for contacts with these deviations, shape (n,).

    As of the other parameters (:func:`price_of_face`): twice the logarithm of how far the contacts narrow the prior.
    """
    widest = 2 / _SHARPEST_m
    known = np.median(normal_sigma_rad) / _TYPICAL_LENGTH_m
    return float(np.log(max(len(normal_sigma_rad), 2)) + 2 * np.log(max(widest / (np.sqrt(2 * np.pi) * known), 1.0)))


def divide_into_sides(contacts: PlanarContacts, order: Indices) -> list[Side]:
    """The cheapest division of contacts in a given cyclic order, counter-clockwise.

    The cycle is opened where successive normals differ most, and then again at a border found on the other side.
    """
    normals = contacts.normals[order]
    opening = int(np.argmin(np.sum(normals * np.roll(normals, 1, axis=0), axis=1)))
    first_cost, first = _divide_opened(contacts, np.roll(order, -opening))
    if len(first) < 2:
        return first
    opposite = sum(len(side.members) for side in first[: len(first) // 2])
    second_cost, second = _divide_opened(contacts, np.roll(order, -opening - opposite))
    return second if second_cost < first_cost else first


def divide_along(contacts: PlanarContacts, order: Indices) -> list[Side]:
    """The cheapest division of contacts in their order along a line that is not closed."""
    return _divide_opened(contacts, order)[1]


def _divide_opened(contacts: PlanarContacts, order: Indices) -> tuple[float, list[Side]]:
    runs = _Runs(contacts, order)
    straight, bent = runs.fit(is_round=False), runs.fit(is_round=True)
    extra = price_of_curvature(contacts.normal_sigma_rad)
    costs = np.minimum(straight, bent + extra)
    total, firsts = cheapest_division(costs, price_of_face(contacts.point_sigma_m, contacts.normal_sigma_rad))
    sides, end = list[Side](), len(order)
    while end > 0:
        begin = int(firsts[end])
        is_round = bool(bent[begin, end - 1] + extra < straight[begin, end - 1])
        sides.insert(0, runs.side(begin, end, is_round=is_round))
        end = begin
    return total, sides


class _Runs:
    """Every run of successive contacts, and the best side for it."""

    def __init__(self, contacts: PlanarContacts, order: Indices) -> None:
        self._order = order
        self._origin_m = contacts.points_m.mean(axis=0)
        points, normals = contacts.points_m[order] - self._origin_m, contacts.normals[order]
        rows = np.concatenate([features(points)[:, None], slopes(points)], axis=1)
        weights = np.column_stack([contacts.point_sigma_m[order], *2 * [contacts.normal_sigma_rad[order]]]) ** -2.0
        targets = np.column_stack([np.zeros(len(order)), normals])
        self._matrices = np.einsum("nki,nk,nkj->nij", rows, weights, rows)
        self._right = np.einsum("nki,nk,nk->ni", rows, weights, targets)
        self._constants = np.sum(weights * targets**2, axis=1)

    def fit(self, *, is_round: bool) -> Array:
        """Chi-square of every run as one side, shape (n, n); entry (i, j), j >= i, has the contacts i to j."""
        count = len(self._order)
        begin, end = np.triu_indices(count, k=LEAST_ON_ARC - 1 if is_round else 0)
        matrices, right, constants = (
            _between(each, begin, end) for each in (self._matrices, self._right, self._constants)
        )
        matrices[:, 0, 0] += _PRIOR_m2
        numbers = _solve(matrices, right, is_round=is_round)
        misfit = np.maximum(constants - np.einsum("ri,ri->r", right, numbers), 0.0)
        costs = np.full((count, count), np.inf)
        costs[begin, end] = np.where(_is_a_circle(numbers), misfit, np.inf) if is_round else misfit
        return costs

    def side(self, begin: int, end: int, *, is_round: bool) -> Side:
        """The best side of the contacts from ``begin`` up to ``end``, without that."""
        matrix, right = self._matrices[begin:end].sum(axis=0), self._right[begin:end].sum(axis=0)
        matrix[0, 0] += _PRIOR_m2
        numbers = _solve(matrix[None], right[None], is_round=is_round)[0]
        covariance = np.zeros((4, 4))
        free = slice(0, 4) if is_round else _DIRECTION
        covariance[free, free] = np.linalg.inv(matrix[free, free])
        misfit = float(self._constants[begin:end].sum() - right @ numbers)
        return Side(numbers, covariance, self._origin_m, self._order[begin:end], max(misfit, 0.0))


def _solve(matrices: Array, right: Array, *, is_round: bool) -> Array:
    """The numbers of the best sides, shape (r, 4), scaled to gradients of length one."""
    numbers = np.zeros_like(right)
    free = slice(0, 4) if is_round else _DIRECTION
    numbers[:, free] = np.linalg.solve(matrices[:, free, free], right[:, free, None])[..., 0]
    return numbers


def _is_a_circle(numbers: Array) -> NDArray[np.bool_]:
    """Whether sides, shape (r, 4), have a radius, one not below the smallest, and the scale that a side has."""
    squared_slope = np.sum(numbers[:, 1:3] ** 2, axis=1) - 4 * numbers[:, 0] * numbers[:, 3]
    return np.asarray(
        (np.abs(numbers[:, 0]) < 1 / (2 * _SHARPEST_m)) & (numbers[:, 0] != 0.0) & (np.abs(squared_slope - 1) < 0.5)
    )


def _between(each: Array, begin: Indices, end: Indices) -> Array:
    """Sums of rows from ``begin`` to ``end``, with that."""
    sums = np.concatenate([np.zeros_like(each[:1]), np.cumsum(each, axis=0)])
    return np.asarray(sums[end + 1] - sums[begin])


def features(places_m: Array) -> Array:
    """What a side's value is linear in, shape (q, 4)."""
    return np.column_stack([np.sum(places_m**2, axis=1), places_m, np.ones(len(places_m))])


def slopes(places_m: Array) -> Array:
    """What both components of its gradient are linear in, shape (q, 2, 4)."""
    rows = np.zeros((len(places_m), 2, 4))
    rows[:, [0, 1], [0, 0]] = 2 * places_m
    rows[:, 0, 1] = rows[:, 1, 2] = 1.0
    return rows
