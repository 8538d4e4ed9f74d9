"""Straight runs of contacts: the cost of each as one face, the cheapest division into runs, and shared directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from drivers.core.contacts import Array

_NEWTON_STEPS = 12
_LARGEST_TURN_rad = 0.3
_SETTLED_rad = 1e-9


def fit_direction(xx: Any, xy: Any, yy: Any, gx: Any, gy: Any) -> Any:
    """The angle a of ``u = (cos a, sin a)`` that makes ``u' S u - 2 u' g`` least, near the direction of g.

    S = [[xx, xy], [xy, yy]] is the weighted scatter of the points, g the weighted sum of the normals, so that this
    is the chi-square of a line with the normal u, up to a constant. Arrays of one shape, or numbers.
    """
    angle = np.arctan2(gy, gx)
    going = np.ones(np.shape(angle), dtype=bool)
    for _ in range(_NEWTON_STEPS):
        c, s = np.cos(angle), np.sin(angle)
        slope = (yy - xx) * c * s + xy * (c * c - s * s) + gx * s - gy * c
        along = gx * c + gy * s
        curvature = np.maximum(np.maximum((yy - xx) * (c * c - s * s) - 4 * xy * c * s + along, np.abs(along)), 1e-9)
        turn = np.where(going, np.clip(slope / curvature, -_LARGEST_TURN_rad, _LARGEST_TURN_rad), 0.0)
        angle = angle - turn
        going &= np.abs(turn) >= _SETTLED_rad
        if not going.any():
            break
    return angle


def chi_square_at(angle: Any, moments: Array) -> Any:
    """Chi-square of faces for a given direction of the unit normal.

    Args:
        angle: of the normal, radians; of one face, or an array.
        moments: xx, xy, yy, gx, gy as in :func:`fit_direction`, and the constant that it leaves out, shape (..., 6).
    """
    c, s = np.cos(angle), np.sin(angle)
    xx, xy, yy, gx, gy, constant = np.moveaxis(moments, -1, 0)
    return xx * c * c + 2 * xy * c * s + yy * s * s - 2 * (gx * c + gy * s) + constant


def direction_variance(angle: Any, moments: Array) -> Any:
    """Variance of the best direction of faces, square radians; arguments as of :func:`chi_square_at`."""
    c, s = np.cos(angle), np.sin(angle)
    xx, xy, yy, gx, gy, _ = np.moveaxis(moments, -1, 0)
    across = xx * s * s - 2 * xy * c * s + yy * c * c
    return 1 / (across + c * gx + s * gy)


def turn_back(moments: Array, turns: Any) -> Array:
    """The moments of the same faces for a direction rotated back by this many quarter turns; arrays, or one face."""
    xx, xy, yy, gx, gy, constant = np.moveaxis(moments, -1, 0)
    odd, quarters = np.mod(turns, 2) == 1, np.mod(turns, 4)
    turned = [np.where(odd, yy, xx), np.where(odd, -xy, xy), np.where(odd, xx, yy)]
    turned += [np.choose(quarters, [gx, gy, -gx, -gy]), np.choose(quarters, [gy, -gx, -gy, gx])]
    return np.stack([*turned, constant], axis=-1)


def most_gained(moments: Array, angles: Array, sizes: Array, loners: float) -> tuple[float, int, int]:
    """The two groups of faces that gain most chi-square by sharing one direction up to quarter turns.

    The gain is measured against two penalties of a separate direction: the narrowing of its prior over a quarter turn,
    and the prior over groupings of faces (a Chinese restaurant process), in which few large groups are likely and a
    pair among many faces is a coincidence.

    Args:
        moments: of the groups, shape (g, 6), see :func:`chi_square_at`.
        angles: their best directions, shape (g,).
        sizes: their numbers of faces, shape (g,).
        loners: prior weight of a separate direction for a face, relative to joining one other face.

    Returns:
        The gain, zero if there is none, and the two groups, the earlier one first.
    """
    second, first = np.tril_indices(len(angles), -1)
    if not len(first):
        return 0.0, 0, 0
    quarter = np.pi / 2
    turns = np.rint((angles[second] - angles[first]) / quarter).astype(np.int64)
    both = moments[first] + turn_back(moments[second], turns)
    together = chi_square_at(fit_direction(*both[:, :5].T), both)
    alone, variances = chi_square_at(angles, moments), direction_variance(angles, moments)
    narrowing = quarter / np.sqrt(2 * np.pi * (variances[first] + variances[second]))
    grouping = gammaln(sizes[first] + sizes[second]) - gammaln(sizes[first]) - gammaln(sizes[second])
    gains = 2 * (np.log(np.fmax(narrowing, 1.0)) + grouping - np.log(loners))
    gains -= together - alone[first] - alone[second]
    best = int(np.argmax(gains))
    if not gains[best] > 0:
        return 0.0, 0, 0
    return float(gains[best]), int(first[best]), int(second[best])


def run_costs(points: Array, normals: Array, point_weights: Array, normal_weights: Array) -> tuple[Array, Array, Array]:
    """Chi-square, direction and offset of every run of successive contacts as one face.

    Args:
        points: contacts in their order along the outline, shape (n, 2); near the origin, for the sums' accuracy.
        normals: unit normals, shape (n, 2).
        point_weights, normal_weights: inverse variances, shape (n,).

    Returns:
        Three arrays of shape (n, n); entry (i, j), j >= i, is the run of the contacts i to j.
    """
    (x, y), v, h = points.T, point_weights, normal_weights
    terms = [v, v * x, v * y, v * x * x, v * x * y, v * y * y, h, h * normals[:, 0], h * normals[:, 1]]
    begin, end = np.triu_indices(len(points))
    w, sx, sy, sxx, sxy, syy, h, gx, gy = _sums_of_runs(terms)[begin, end].T
    xx, xy, yy = sxx - sx * sx / w, sxy - sx * sy / w, syy - sy * sy / w
    angle = fit_direction(xx, xy, yy, gx, gy)
    c, s = np.cos(angle), np.sin(angle)
    misfit = xx * c * c + 2 * xy * c * s + yy * s * s + 2 * h - 2 * (gx * c + gy * s)
    costs, angles, offsets = np.zeros((3, len(points), len(points)))
    costs[begin, end], angles[begin, end] = np.maximum(misfit, 0.0), angle
    offsets[begin, end] = (sx * c + sy * s) / w
    return costs, angles, offsets


def _sums_of_runs(terms: Sequence[Array]) -> Array:
    """Sums of some terms over every run, shape (n, n, terms), each from its first member on: differences of sums from
    the beginning would be less accurate.
    """
    rows = np.column_stack(terms)
    sums, so_far = np.zeros((len(rows), *rows.shape)), np.zeros_like(rows)
    for j, row in enumerate(rows):
        so_far[: j + 1] += row
        sums[: j + 1, j] = so_far[: j + 1]
    return sums


def cheapest_division(costs: Array, price: float) -> tuple[float, NDArray[np.int64]]:
    """Divide 0..n-1 into runs with the least total cost, where each run costs an additional ``price`` (dynamic
    programming).

    Returns:
        The total, and the first member of the last run for every prefix, shape (n + 1,).
    """
    n = len(costs)
    best, first = np.zeros(n + 1), np.zeros(n + 1, np.int64)
    for j in range(1, n + 1):
        totals = best[:j] + costs[:j, j - 1] + price
        first[j] = np.argmin(totals)
        best[j] = totals[first[j]]
    return float(best[n]), first
