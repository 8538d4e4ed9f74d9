"""Divides contacts in space into the planes on which they lie: the clusters of appendix A, found by likelihood.

The thesis joins contacts of similar normals and then splits the clusters by paths. Here points and normals of a cluster
are compared with one plane, each with its own standard deviation. Starting with single contacts, clusters are merged as
long as the parameters saved are worth more than the added misfit (BIC). Faces on the same plane share it; the parts of
the plane that are surface are found by :mod:`tactile_lab.slam.shape.solids.cells`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.observations import check_contacts
from tactile_lab.slam.shape.solids.merging import fit_normals, merge_clusters

PARAMETERS_PER_PLANE = 4
"""Two angles, the offset, and the choice of its members."""

_LARGEST_ANGLE_rad = np.deg2rad(50.0)
_REASSIGNMENTS = 30
_WORTH_MOVING = 4.0
"""A contact changes its plane only if this much chi-square is saved, so that it cannot go back and forth."""


@dataclass(frozen=True)
class Planes:
    """Contacts divided into planes; the planes with most contacts come first.

    Attributes:
        labels: plane of each contact, shape (n,).
        normals: outward unit normals, shape (S, 3).
        offsets_m: each plane is ``normal . x = offset``, shape (S,).
        chi_square: of all points and normals.
    """

    labels: NDArray[np.int64]
    normals: Array
    offsets_m: Array
    chi_square: float

    @property
    def count(self) -> int:
        return len(self.offsets_m)

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Number of contacts on each plane, shape (S,)."""
        return np.bincount(self.labels, minlength=self.count)

    def heights_m(self, points_m: Array) -> Array:
        """Signed distances of points (q, 3) from all planes, positive outside, shape (q, S)."""
        return np.asarray(points_m @ self.normals.T - self.offsets_m)


@dataclass(frozen=True)
class WeightedContacts:
    """Contacts with the inverse variances of their points and normals, shapes (n, 3) and (n,)."""

    points_m: Array
    normals: Array
    point_weights: Array
    normal_weights: Array

    def __len__(self) -> int:
        return len(self.points_m)

    def of(self, members: NDArray[np.intp]) -> WeightedContacts:
        """Some of the contacts."""
        return WeightedContacts(*(column[members] for column in vars(self).values()))

    def chi_squares(self, normals: Array, offsets_m: Array) -> Array:
        """Misfit of every contact to every plane, shape (n, S)."""
        misses_m = self.points_m @ normals.T - offsets_m
        turns = np.maximum(2 - 2 * self.normals @ normals.T, 0.0)
        return np.asarray(self.point_weights[:, None] * misses_m**2 + self.normal_weights[:, None] * turns)


def segment_planes(
    points_m: Array, normals: Array, point_sigma_m: Array | float, normal_sigma_rad: Array | float
) -> Planes:
    """Divide contacts into planes.

    Args:
        points_m: shape (n, 3), metres.
        normals: outward unit normals, shape (n, 3).
        point_sigma_m: standard deviation of the points, shape (n,) or one for all.
        normal_sigma_rad: of the normals per axis, shape (n,) or one for all.

    Raises:
        ShapeError: contacts that cannot be used (see :func:`check_contacts`).
    """
    contacts = weighted_contacts(points_m, normals, point_sigma_m, normal_sigma_rad)
    return divide(contacts)


def weighted_contacts(
    points_m: Array, normals: Array, point_sigma_m: Array | float, normal_sigma_rad: Array | float
) -> WeightedContacts:
    """Check contacts and add weights from their sigmas. Raises ShapeError as :func:`check_contacts`."""
    points_m, normals = np.array(points_m, dtype=float), np.array(normals, dtype=float)
    sigmas = [
        np.broadcast_to(np.asarray(sigma, dtype=float), len(points_m)) for sigma in (point_sigma_m, normal_sigma_rad)
    ]
    check_contacts(points_m, normals, *sigmas)
    point_weights, normal_weights = (1 / np.maximum(sigma, 1e-6) ** 2 for sigma in sigmas)
    return WeightedContacts(points_m, normals, point_weights, normal_weights)


def divide(contacts: WeightedContacts) -> Planes:
    """Merge clusters, reassign single contacts, and dissolve planes that are not worth their parameters."""
    price = plane_price(len(contacts))
    columns = contacts.points_m, contacts.normals, contacts.point_weights, contacts.normal_weights
    clusters = merge_clusters(*columns, price, float(np.cos(_LARGEST_ANGLE_rad)))
    planes = fit_planes(contacts, clusters)
    for _ in range(_REASSIGNMENTS):
        fewer = _dissolve(contacts, planes, price)
        changed = fit_planes(contacts, _reassign(contacts, fewer))
        if changed.count == planes.count and np.array_equal(changed.labels, planes.labels):
            break
        planes = changed
    return planes


def plane_price(count: int) -> float:
    """Chi-square that an additional plane must save for this number of contacts (BIC)."""
    return float(PARAMETERS_PER_PLANE * np.log(max(count, 2)))


def fit_planes(contacts: WeightedContacts, labels: NDArray[np.int64]) -> Planes:
    """The best plane of each cluster; clusters are renumbered, largest first."""
    _, first, label, sizes = np.unique(labels, return_index=True, return_inverse=True, return_counts=True)
    order = np.lexsort((first, -sizes))
    label = np.argsort(order)[label]
    normals, offsets_m = _best_planes(contacts, label, len(order))
    chi_square = contacts.chi_squares(normals, offsets_m)[np.arange(len(contacts)), label].sum()
    return Planes(label.astype(np.int64), normals, offsets_m, float(chi_square))


def _best_planes(contacts: WeightedContacts, label: NDArray[np.int64], count: int) -> tuple[Array, Array]:
    """Normals (k, 3) and offsets (k,) of the planes of least chi-square through the contacts of each label."""
    weights = contacts.point_weights[:, None]
    middles = _sums(label, weights * contacts.points_m, count) / _sums(label, weights, count)
    arms = contacts.points_m - middles[label]
    scatters = _sums(label, weights[..., None] * arms[:, :, None] * arms[:, None, :], count)
    normals = fit_normals(scatters, _sums(label, contacts.normal_weights[:, None] * contacts.normals, count))
    return normals, np.einsum("ki,ki->k", normals, middles)


def _sums(label: NDArray[np.int64], terms: Array, count: int) -> Array:
    sums = np.zeros((count, *terms.shape[1:]))
    np.add.at(sums, label, terms)
    return sums


def _reassign(contacts: WeightedContacts, planes: Planes) -> NDArray[np.int64]:
    """Labels that assign each contact to its best plane."""
    costs = contacts.chi_squares(planes.normals, planes.offsets_m)
    rows = np.arange(len(contacts))
    best = costs.argmin(axis=1)
    moving = costs[rows, best] < costs[rows, planes.labels] - _WORTH_MOVING
    return np.where(moving, best, planes.labels)


def _dissolve(contacts: WeightedContacts, planes: Planes, price: float) -> Planes:
    """Remove the smallest plane whose contacts fit other planes, or together with those of another, at less than its
    cost.

    A few contacts that agree better with each other than with their face by coincidence can be chosen in many ways; the
    entropy of the labels is the penalty for this choice.
    """
    costs = contacts.chi_squares(planes.normals, planes.offsets_m)
    sizes = planes.sizes
    for plane in range(planes.count - 1, 0, -1):
        members = np.flatnonzero(planes.labels == plane)
        elsewhere = costs[members].copy()
        elsewhere[:, plane] = np.inf
        host = int(elsewhere.sum(axis=0).argmin())
        worth = price + _label_entropy(sizes[plane], sizes[host])
        if elsewhere.min(axis=1).sum() - costs[members, plane].sum() < worth:
            return fit_planes(contacts, _with_labels(planes.labels, members, elsewhere.argmin(axis=1)))
        if _joining_cost(contacts, planes, costs, plane, host) < worth:
            return fit_planes(contacts, _with_labels(planes.labels, members, np.full(len(members), host)))
    return planes


def _joining_cost(contacts: WeightedContacts, planes: Planes, costs: Array, plane: int, host: int) -> float:
    """Chi-square added by replacing two planes with one."""
    both = np.flatnonzero((planes.labels == plane) | (planes.labels == host))
    members = contacts.of(both)
    together = members.chi_squares(*_best_planes(members, np.zeros(len(both), np.int64), 1)).sum()
    return float(together - costs[both, planes.labels[both]].sum())


def _label_entropy(first: int, second: int) -> float:
    """Twice the log likelihood lost by distinguishing the members of two clusters."""
    sizes = np.array([first + second, first, second], dtype=float)
    return float(2 * np.sum(sizes * np.log(sizes) * [1, -1, -1]))


def _with_labels(labels: NDArray[np.int64], members: NDArray[np.intp], changed: NDArray[np.intp]) -> NDArray[np.int64]:
    labels = labels.copy()
    labels[members] = changed
    return labels
