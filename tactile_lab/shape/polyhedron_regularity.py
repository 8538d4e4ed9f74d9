"""Right angles, parallel faces and upright walls, where the contacts allow them.

Made things are full of regularities, and each one is a parameter less. A regularity is taken where the misfit it adds
is smaller than what a parameter costs (BIC). The directions of all planes are one Gaussian state; a regularity is an
exact measurement of it, with the usual gate, so that what one wall knows helps all walls tied to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.polyhedron_planes import Planes, WeightedContacts

_LARGEST_TURN_rad = np.deg2rad(15.0)
_VANISHING = 1e-9
"""Square radians: what is known this well is already implied by other regularities."""
_ROUNDS = 3


@dataclass(frozen=True)
class RegularPlanes:
    """Planes with their regularities and what is known of them.

    Attributes:
        planes: as before, turned to meet the regularities.
        middles_m: weighted middle of each plane's contacts, shape (S, 3).
        turn_covariances: of each normal, shape (S, 3, 3), square radians.
        offset_variances_m2: of each plane's distance at its middle, shape (S,).
        log_angle_areas: logarithm of the product of each normal's two principal sigmas by its own contacts, shape (S,).
        saved: parameters that the regularities make unnecessary.
    """

    planes: Planes
    middles_m: Array
    turn_covariances: Array
    offset_variances_m2: Array
    log_angle_areas: Array
    saved: int

    def sigma_m(self, plane: int, points_m: Array) -> Array:
        """Standard deviation of a plane along its normal at points of shape (q, 3), metres."""
        arms = points_m - self.middles_m[plane]
        turned = np.einsum("qi,ij,qj->q", arms, self.turn_covariances[plane], arms)
        return np.asarray(np.sqrt(np.maximum(turned, 0.0) + self.offset_variances_m2[plane]))


@dataclass(frozen=True)
class _Regularity:
    """``gap = rows . directions`` is to vanish, with directions all normals one after the other."""

    gap: Array
    rows: Array


def regularise(contacts: WeightedContacts, planes: Planes, *, upright: bool) -> RegularPlanes:
    """Turn planes until they are as regular as the contacts allow.

    Args:
        contacts: of all planes.
        planes: as fitted to them.
        upright: the third axis is vertical, and horizontal and vertical planes are likely.
    """
    middles, covariance, offset_variances = _uncertainty(contacts, planes)
    log_areas = np.array([_log_angle_area(block) for block in _own_blocks(covariance)])
    normals, saved = _regular_normals(planes.normals, covariance, float(np.log(len(contacts))), upright)
    offsets = np.sum(normals * middles, axis=1)
    chi_square = contacts.chi_squares(normals, offsets)[np.arange(len(contacts)), planes.labels].sum()
    regular = Planes(planes.labels, normals, offsets, float(chi_square))
    return RegularPlanes(regular, middles, _own_blocks(covariance), offset_variances, log_areas, saved)


def _own_blocks(covariance: Array) -> Array:
    """The covariance of each normal, shape (S, 3, 3)."""
    count = len(covariance) // 3
    return covariance.reshape(count, 3, count, 3)[np.arange(count), :, np.arange(count), :]


def _log_angle_area(covariance: Array) -> float:
    """Logarithm of the product of the two sigmas of a normal."""
    return float(0.5 * np.log(np.linalg.eigvalsh(covariance)[1:]).sum())


def _uncertainty(contacts: WeightedContacts, planes: Planes) -> tuple[Array, Array, Array]:
    """Middles, joint covariance of the normals (3S, 3S), and variances of the offsets at the middles."""
    middles, variances = np.empty((planes.count, 3)), np.empty(planes.count)
    covariance = np.zeros((3 * planes.count, 3 * planes.count))
    for plane, normal in enumerate(planes.normals):
        members = np.flatnonzero(planes.labels == plane)
        weights = contacts.point_weights[members]
        middles[plane] = np.average(contacts.points_m[members], axis=0, weights=weights)
        arms = contacts.points_m[members] - middles[plane]
        across = np.linalg.svd(normal[None])[2][1:]
        known = across @ ((arms.T * weights) @ arms) @ across.T
        known += np.eye(2) * (contacts.normal_weights[members] @ (contacts.normals[members] @ normal))
        rows = slice(3 * plane, 3 * plane + 3)
        covariance[rows, rows] = across.T @ np.linalg.inv(known) @ across
        variances[plane] = 1 / weights.sum()
    return middles, covariance, variances


def _regular_normals(normals: Array, covariance: Array, price: float, upright: bool) -> tuple[Array, int]:
    """Normals that meet the regularities; the covariance is updated in place."""
    normals = normals.copy()
    candidates = list(_candidates(len(normals), upright))
    tests = [_test(_stated(kind, normals), covariance) for kind in candidates]
    order = np.argsort([test / len(_stated(kind, normals).gap) for kind, test in zip(candidates, tests, strict=True)])
    taken = []
    saved = 0
    for index in order:
        regularity = _stated(candidates[index], normals)
        if np.abs(regularity.gap).max() > np.sin(_LARGEST_TURN_rad):
            continue
        rank = _open_rank(regularity, covariance)
        if rank and _test(regularity, covariance) < price * rank:
            normals = _applied(regularity, normals, covariance)
            taken.append(candidates[index])
            saved += rank
    for _ in range(_ROUNDS):
        for kind in taken:
            normals = _settled(_stated(kind, normals), normals)
    return normals, saved


Kind = tuple[str, int, int]


def _candidates(count: int, upright: bool) -> Iterator[Kind]:
    for a in range(count):
        if upright:
            yield ("horizontal", a, a)
            yield ("vertical", a, a)
        for b in range(a):
            yield ("parallel", a, b)
            yield ("right angle", a, b)


def _stated(kind: Kind, normals: Array) -> _Regularity:
    name, a, b = kind
    rows = np.zeros((2, len(normals), 3))
    if name == "vertical":
        rows[0, a, 2] = 1.0
        return _Regularity(normals[a, 2:], rows[:1].reshape(1, -1))
    if name == "horizontal":
        rows[0, a, 0] = rows[1, a, 1] = 1.0
        return _Regularity(normals[a, :2], rows.reshape(2, -1))
    if name == "right angle":
        rows[0, a], rows[0, b] = normals[b], normals[a]
        return _Regularity(np.array([normals[a] @ normals[b]]), rows[:1].reshape(1, -1))
    across = np.linalg.svd(normals[a][None])[2][1:]
    side = np.sign(normals[a] @ normals[b])
    rows[:, b], rows[:, a] = across, -side * across
    return _Regularity(across @ normals[b], rows.reshape(2, -1))


def _test(regularity: _Regularity, covariance: Array) -> float:
    """Chi-square that the regularity adds."""
    spread = regularity.rows @ covariance @ regularity.rows.T + _VANISHING * np.eye(len(regularity.gap))
    return float(regularity.gap @ np.linalg.solve(spread, regularity.gap))


def _open_rank(regularity: _Regularity, covariance: Array) -> int:
    """How many parameters it would fix that are not fixed yet."""
    spread = regularity.rows @ covariance @ regularity.rows.T
    return int(np.count_nonzero(np.linalg.eigvalsh(spread) > 10 * _VANISHING))


def _applied(regularity: _Regularity, normals: Array, covariance: Array) -> Array:
    spread = regularity.rows @ covariance @ regularity.rows.T + _VANISHING * np.eye(len(regularity.gap))
    gain = np.linalg.solve(spread, regularity.rows @ covariance).T
    covariance -= gain @ (regularity.rows @ covariance)
    moved = normals - (gain @ regularity.gap).reshape(-1, 3)
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))


def _settled(regularity: _Regularity, normals: Array) -> Array:
    """What linearisation left over is shared evenly."""
    step = np.linalg.pinv(regularity.rows) @ regularity.gap
    moved = normals - step.reshape(-1, 3)
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))
