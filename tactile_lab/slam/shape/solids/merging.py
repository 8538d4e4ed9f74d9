"""Merges contacts into planes from the bottom up: every cluster is represented by its moments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array

_NEWTON_STEPS = 50
_SETTLED = 1e-12
_LEAST_PULL = 1e-9

Indices = NDArray[np.int64]


def fit_normals(scatters: Array, pulls: Array) -> Array:
    """The unit vectors u that make ``u' scatter u - 2 u' pull`` least.

    With the weighted scatters of points (k, 3, 3) and the weighted sums of normals (k, 3) this is, up to a constant,
    the chi-square of planes with the normals u.
    """
    axes, _, _, shares = _solve(scatters, pulls)
    return np.asarray(np.einsum("kij,kj->ki", axes, shares))


def _solve(scatters: Array, pulls: Array) -> tuple[Array, Array, Array, Array]:
    """Principal axes of the scatters, and along them the scatter, the pull and the best unit vector.

    Its components are ``pull / (scatter + shift)``; Newton's method finds the shift that makes their length one, from
    below, where it converges monotonically (Moré and Sorensen 1983: the trust region's boundary).
    """
    spread, axes = np.linalg.eigh(scatters)
    along = np.einsum("kij,ki->kj", axes, pulls)
    along[np.abs(along) < _LEAST_PULL] = _LEAST_PULL
    shift = (np.abs(along) - spread).max(axis=1, keepdims=True, initial=-np.inf)
    for _ in range(_NEWTON_STEPS):
        stiffness = spread + shift
        shares = along / stiffness
        squared = shares * shares
        total = squared.sum(axis=1, keepdims=True)
        length = np.sqrt(total)
        if not (length - 1 > _SETTLED).any():
            break
        shift += (length - 1) * total / (squared / stiffness).sum(axis=1, keepdims=True)
    return axes, spread, along, shares / length


@dataclass(frozen=True)
class _Moments:
    """Of clusters of contacts.

    Attributes:
        middles: weighted mean points, shape (k, 3).
        scatters: weighted scatters about them, shape (k, 3, 3).
        pulls: weighted sums of normals, shape (k, 3).
        point_weights, normal_weights: sums of inverse variances, shape (k,).
    """

    middles: Array
    scatters: Array
    pulls: Array
    point_weights: Array
    normal_weights: Array

    def of(self, clusters: Indices) -> _Moments:
        return _Moments(*(column[clusters] for column in vars(self).values()))

    def with_other(self, other: _Moments) -> _Moments:
        """Each cluster together with another."""
        total = self.point_weights + other.point_weights
        share = self.point_weights * other.point_weights / total
        gap = self.middles - other.middles
        return _Moments(
            (self.point_weights[:, None] * self.middles + other.point_weights[:, None] * other.middles)
            / total[:, None],
            self.scatters + other.scatters + share[:, None, None] * gap[:, :, None] * gap[:, None, :],
            self.pulls + other.pulls,
            total,
            self.normal_weights + other.normal_weights,
        )

    def chi_squares(self) -> Array:
        """Of the best plane of each cluster, shape (k,)."""
        _, spread, along, shares = _solve(self.scatters, self.pulls)
        return np.asarray(2 * self.normal_weights + (shares * (spread * shares - 2 * along)).sum(axis=1))

    def replace(self, cluster: int, other: _Moments) -> None:
        """Put another cluster into the place of one."""
        for column, new in zip(vars(self).values(), vars(other).values(), strict=True):
            column[cluster] = new[0]


def merge_clusters(
    points: Array, normals: Array, point_weights: Array, normal_weights: Array, limit: float, least_cosine: float
) -> Indices:
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
    pulls = normals * normal_weights[:, None]
    moments = _Moments(points.copy(), np.zeros((count, 3, 3)), pulls, point_weights.copy(), normal_weights.copy())
    chi_squares, labels = np.zeros(count), np.arange(count)
    costs = np.full((count, count), np.inf)
    one, other = np.nonzero(np.triu(normals @ normals.T > least_cosine, 1))
    costs[one, other] = costs[other, one] = moments.of(one).with_other(moments.of(other)).chi_squares()
    while count:
        a, b = sorted(divmod(int(np.argmin(costs)), count))
        if not costs[a, b] <= limit:
            break
        moments.replace(a, moments.of(np.array([a])).with_other(moments.of(np.array([b]))))
        chi_squares[a] += costs[a, b] + chi_squares[b]
        labels[labels == b] = a
        costs[[a, b]] = costs[:, [a, b]] = np.inf
        _weigh_mergers(costs, moments, chi_squares, labels, a, least_cosine)
    return labels


def _weigh_mergers(
    costs: Array, moments: _Moments, chi_squares: Array, labels: Indices, a: int, least_cosine: float
) -> None:
    """Costs of merging cluster a with each of the others whose mean normals are near its own."""
    lengths = np.sqrt(np.einsum("ki,ki->k", moments.pulls, moments.pulls))
    near = moments.pulls @ moments.pulls[a] > least_cosine * lengths * lengths[a]
    near &= labels == np.arange(len(labels))
    near[a] = False
    others = np.flatnonzero(near)
    both = moments.of(others).with_other(moments.of(np.full(len(others), a)))
    costs[a, others] = costs[others, a] = both.chi_squares() - chi_squares[a] - chi_squares[others]
