"""Merges contacts into planes from the bottom up, in compiled code: every cluster is represented by its moments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.compiled import compile_when_called

_NEWTON_STEPS = 10
_LARGEST_STEP = 0.3
_SETTLED = 1e-7


@compile_when_called
def fit_normal(scatter: Array, pull: Array) -> Array:
    """The unit vector u that makes ``u' scatter u - 2 u' pull`` least, near the direction of ``pull``.

    With the weighted scatter of points (3, 3) and the weighted sum of normals (3,) this is, up to a constant, the
    chi-square of a plane with the normal u. Newton's method on the sphere.
    """
    u = pull / np.sqrt(pull[0] ** 2 + pull[1] ** 2 + pull[2] ** 2)
    first, second = np.empty(3), np.empty(3)
    for _ in range(_NEWTON_STEPS):
        least = 0 if abs(u[0]) < 0.6 else 1
        following, last = (least + 1) % 3, (least + 2) % 3
        length = np.sqrt(u[following] ** 2 + u[last] ** 2)
        first[least], first[following], first[last] = 0.0, u[last] / length, -u[following] / length
        for k in range(3):
            second[k] = u[(k + 1) % 3] * first[(k + 2) % 3] - u[(k + 2) % 3] * first[(k + 1) % 3]
        g1 = g2 = h11 = h12 = h22 = along = 0.0
        for i in range(3):
            row = su1 = su2 = 0.0
            for j in range(3):
                row += scatter[i, j] * u[j]
                su1 += scatter[i, j] * first[j]
                su2 += scatter[i, j] * second[j]
            g1 += first[i] * (row - pull[i])
            g2 += second[i] * (row - pull[i])
            along += u[i] * (pull[i] - row)
            h11 += first[i] * su1
            h12 += first[i] * su2
            h22 += second[i] * su2
        h11, h22 = max(h11 + along, 1e-9), max(h22 + along, 1e-9)
        if h11 * h22 - h12 * h12 < 1e-6 * h11 * h22:
            h12 = 0.0
        determinant = h11 * h22 - h12 * h12
        d1, d2 = -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant
        size = np.sqrt(d1 * d1 + d2 * d2)
        if size > _LARGEST_STEP:
            d1, d2 = d1 * _LARGEST_STEP / size, d2 * _LARGEST_STEP / size
        norm = 0.0
        for k in range(3):
            u[k] += d1 * first[k] + d2 * second[k]
            norm += u[k] * u[k]
        for k in range(3):
            u[k] /= np.sqrt(norm)
        if size < _SETTLED:
            break
    return np.asarray(u)


@compile_when_called
def merged_chi_square(
    middles: Array, scatters: Array, pulls: Array, point_weights: Array, normal_weights: Array, a: int, b: int
) -> float:
    """Chi-square of the plane through two clusters together."""
    share = point_weights[a] * point_weights[b] / (point_weights[a] + point_weights[b])
    scatter = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            gap = (middles[a, i] - middles[b, i]) * (middles[a, j] - middles[b, j])
            scatter[i, j] = scatters[a, i, j] + scatters[b, i, j] + share * gap
    pull = pulls[a] + pulls[b]
    u = fit_normal(scatter, pull)
    chi_square = 2 * (normal_weights[a] + normal_weights[b])
    for i in range(3):
        chi_square -= 2 * u[i] * pull[i]
        for j in range(3):
            chi_square += u[i] * scatter[i, j] * u[j]
    return float(chi_square)


@compile_when_called
def _absorb(
    middles: Array, scatters: Array, pulls: Array, point_weights: Array, normal_weights: Array, a: int, b: int
) -> None:
    """Moments of cluster a after it has taken in b."""
    one, other = point_weights[a], point_weights[b]
    total = one + other
    share = one * other / total
    for i in range(3):
        for j in range(3):
            gap = (middles[a, i] - middles[b, i]) * (middles[a, j] - middles[b, j])
            scatters[a, i, j] += scatters[b, i, j] + share * gap
    for i in range(3):
        middles[a, i] = (one * middles[a, i] + other * middles[b, i]) / total
        pulls[a, i] += pulls[b, i]
    point_weights[a], normal_weights[a] = total, normal_weights[a] + normal_weights[b]


@compile_when_called
def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compile_when_called
def _choose_partner(costs: Array, partner: NDArray[np.int64], cheapest: Array, a: int) -> None:
    """Store the other cluster with which cluster a merges at the least cost."""
    partner[a] = np.argmin(costs[a])
    cheapest[a] = costs[a, partner[a]]


@compile_when_called
def _leave_out(costs: Array, cheapest: Array, labels: NDArray[np.int64], a: int, b: int) -> None:
    """Mark cluster b as part of a, so that it is not merged again."""
    cheapest[b] = np.inf
    for c in range(len(labels)):
        costs[b, c], costs[c, b] = np.inf, np.inf
        if labels[c] == b:
            labels[c] = a


@compile_when_called
def merge_clusters(
    points: Array, normals: Array, point_weights: Array, normal_weights: Array, limit: float, least_cosine: float
) -> NDArray[np.int64]:
    """Merge clusters of contacts, always those two whose common plane increases chi-square least.

    Args:
        points, normals: contacts, each of shape (n, 3).
        point_weights, normal_weights: inverse variances, each of shape (n,).
        limit: merging stops when every merger adds more than this.
        least_cosine: clusters whose mean normals differ by more are never merged.

    Returns:
        The cluster of each contact: the smallest index of its members, shape (n,).
    """
    count = len(points)
    middles, scatters = points.copy(), np.zeros((count, 3, 3))
    pulls = normals * normal_weights.reshape(-1, 1)
    weights, normal_weights = point_weights.copy(), normal_weights.copy()
    chi_squares, labels = np.zeros(count), np.arange(count)
    costs = np.full((count, count), np.inf)
    partner, cheapest = np.zeros(count, np.int64), np.zeros(count)
    for a in range(count):
        for b in range(a + 1, count):
            if _dot(normals[a], normals[b]) > least_cosine:
                costs[a, b] = merged_chi_square(middles, scatters, pulls, weights, normal_weights, a, b)
                costs[b, a] = costs[a, b]
    for a in range(count):
        _choose_partner(costs, partner, cheapest, a)
    first = np.argmin(cheapest)
    while cheapest[first] <= limit:
        a, b = min(first, partner[first]), max(first, partner[first])
        chi_squares[a] = merged_chi_square(middles, scatters, pulls, weights, normal_weights, a, b)
        _absorb(middles, scatters, pulls, weights, normal_weights, a, b)
        _leave_out(costs, cheapest, labels, a, b)
        for c in range(count):
            if c != a and labels[c] == c:
                cost = np.inf
                cosine = _dot(pulls[a], pulls[c]) / np.sqrt(_dot(pulls[a], pulls[a]) * _dot(pulls[c], pulls[c]))
                if cosine > least_cosine:
                    both = merged_chi_square(middles, scatters, pulls, weights, normal_weights, a, c)
                    cost = both - chi_squares[a] - chi_squares[c]
                costs[a, c], costs[c, a] = cost, cost
                _choose_partner(costs, partner, cheapest, c)
        _choose_partner(costs, partner, cheapest, a)
        first = np.argmin(cheapest)
    return labels
