"""Straight runs of contacts: the cost of each as one face, the cheapest division into runs, and shared directions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.compiled import compile_when_called

_NEWTON_STEPS = 12
_LARGEST_TURN_rad = 0.3


@compile_when_called
def fit_direction(xx: float, xy: float, yy: float, gx: float, gy: float) -> float:
    """The angle a of ``u = (cos a, sin a)`` that makes ``u' S u - 2 u' g`` least, near the direction of g.

    S = [[xx, xy], [xy, yy]] is the weighted scatter of the points, g the weighted sum of the normals, so that this
    is the chi-square of a line with the normal u, up to a constant.
    """
    angle = np.arctan2(gy, gx)
    for _ in range(_NEWTON_STEPS):
        c, s = np.cos(angle), np.sin(angle)
        slope = (yy - xx) * c * s + xy * (c * c - s * s) + gx * s - gy * c
        along = gx * c + gy * s
        curvature = max((yy - xx) * (c * c - s * s) - 4 * xy * c * s + along, abs(along), 1e-9)
        turn = min(max(slope / curvature, -_LARGEST_TURN_rad), _LARGEST_TURN_rad)
        angle -= turn
        if abs(turn) < 1e-9:
            break
    return float(angle)


@compile_when_called
def chi_square_at(angle: float, moments: Array) -> float:
    """Chi-square of faces for a given direction of the unit normal.

    Args:
        angle: of the normal, radians.
        moments: xx, xy, yy, gx, gy as in :func:`fit_direction`, and the constant that it leaves out.
    """
    c, s = np.cos(angle), np.sin(angle)
    scatter = moments[0] * c * c + 2 * moments[1] * c * s + moments[2] * s * s
    return float(scatter - 2 * (moments[3] * c + moments[4] * s) + moments[5])


@compile_when_called
def direction_variance(angle: float, moments: Array) -> float:
    """Variance of the best direction of faces, square radians; arguments as of :func:`chi_square_at`."""
    c, s = np.cos(angle), np.sin(angle)
    across = moments[0] * s * s - 2 * moments[1] * c * s + moments[2] * c * c
    return float(1 / (across + c * moments[3] + s * moments[4]))


@compile_when_called
def turn_back(moments: Array, turns: int) -> Array:
    """The moments of the same faces for a direction rotated back by this many quarter turns."""
    xx, xy, yy, gx, gy, constant = moments
    if turns % 2:
        xx, xy, yy = yy, -xy, xx
    for _ in range(turns % 4):
        gx, gy = gy, -gx
    return np.array([xx, xy, yy, gx, gy, constant])


@compile_when_called
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
    quarter, best, pair = np.pi / 2, 0.0, (0, 0)
    for second in range(len(angles)):
        for first in range(second):
            turned = turn_back(moments[second], int(np.rint((angles[second] - angles[first]) / quarter)))
            both = moments[first] + turned
            together = chi_square_at(fit_direction(both[0], both[1], both[2], both[3], both[4]), both)
            apart = chi_square_at(angles[first], moments[first]) + chi_square_at(angles[second], moments[second])
            variance = direction_variance(angles[first], moments[first])
            variance += direction_variance(angles[second], moments[second])
            narrowing = np.log(max(quarter / np.sqrt(2 * np.pi * variance), 1.0))
            one, other = sizes[first], sizes[second]
            grouping = math.lgamma(one + other) - math.lgamma(one) - math.lgamma(other) - np.log(loners)
            gain = 2 * (narrowing + grouping) - (together - apart)
            if gain > best:
                best, pair = gain, (first, second)
    return best, pair[0], pair[1]


@compile_when_called
def run_costs(points: Array, normals: Array, point_weights: Array, normal_weights: Array) -> tuple[Array, Array, Array]:
    """Chi-square, direction and offset of every run of successive contacts as one face, in O(n^2).

    Args:
        points: contacts in their order along the outline, shape (n, 2); near the origin, for the sums' accuracy.
        normals: unit normals, shape (n, 2).
        point_weights, normal_weights: inverse variances, shape (n,).

    Returns:
        Three arrays of shape (n, n); entry (i, j), j >= i, is the run of the contacts i to j.
    """
    n = len(points)
    costs, angles, offsets = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        w = sx = sy = sxx = sxy = syy = gx = gy = h = 0.0
        for j in range(i, n):
            x, y, v = points[j, 0], points[j, 1], point_weights[j]
            w, sx, sy = w + v, sx + v * x, sy + v * y
            sxx, sxy, syy = sxx + v * x * x, sxy + v * x * y, syy + v * y * y
            h += normal_weights[j]
            gx, gy = gx + normal_weights[j] * normals[j, 0], gy + normal_weights[j] * normals[j, 1]
            xx, xy, yy = sxx - sx * sx / w, sxy - sx * sy / w, syy - sy * sy / w
            angle = fit_direction(xx, xy, yy, gx, gy)
            c, s = np.cos(angle), np.sin(angle)
            misfit = xx * c * c + 2 * xy * c * s + yy * s * s + 2 * h - 2 * (gx * c + gy * s)
            costs[i, j], angles[i, j], offsets[i, j] = max(misfit, 0.0), angle, (sx * c + sy * s) / w
    return costs, angles, offsets


@compile_when_called
def cheapest_division(costs: Array, price: float) -> tuple[float, NDArray[Any]]:
    """Divide 0..n-1 into runs with the least total cost, where each run costs an additional ``price`` (dynamic
    programming).

    Returns:
        The total, and the first member of the last run for every prefix, shape (n + 1,).
    """
    n = len(costs)
    best = np.full(n + 1, np.inf)
    first = np.zeros(n + 1, np.int64)
    best[0] = 0.0
    for j in range(1, n + 1):
        for i in range(j):
            total = best[i] + costs[i, j - 1] + price
            if total < best[j]:
                best[j], first[j] = total, i
    return best[n], first
