"""Straight runs of contacts: what each costs as one face, and the cheapest division into runs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.compiled import compiled

_NEWTON_STEPS = 12
_LARGEST_TURN_rad = 0.3


@compiled
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


@compiled
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


@compiled
def cheapest_division(costs: Array, price: float) -> tuple[float, NDArray[Any]]:
    """Divide 0..n-1 into runs of the least total cost, each run costing ``price`` more (dynamic programming).

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
