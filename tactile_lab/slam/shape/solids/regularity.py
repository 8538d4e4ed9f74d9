"""Makes the planes of a solid as regular as its contacts allow, and gives their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.regularities import RegularNormals, regular_normals
from tactile_lab.slam.shape.solids.planes import Planes, WeightedContacts

_FACING = 0.9
"""Cosine of the angle between a plane's normal and that of a surface on it, at least."""


@dataclass(frozen=True)
class RegularPlanes:
    """Planes with their regularities and their uncertainty.

    Attributes:
        planes: the planes, rotated to satisfy the regularities.
        middles_m: weighted middle of each plane's contacts, shape (S, 3).
        turn_covariances: of each normal, shape (S, 3, 3), square radians.
        offset_variances_m2: of each plane's distance at its middle, shape (S,).
        log_angle_areas: logarithm of the product of each normal's two principal sigmas from its own contacts, shape
            (S,).
        saved: number of parameters that the regularities make unnecessary.
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

    def moves_m(self, points_m: Array, normals: Array) -> Array:
        """How one standard deviation of each error of the planes moves points of a surface along their normals.

        Args:
            points_m, normals: shape (q, 3); a point lies on the nearest plane that faces its way.

        Returns:
            Shape (q, 4 S).
        """
        planes, moves = self.planes, np.zeros((len(points_m), self.planes.count, 4))
        facing = normals @ planes.normals.T > _FACING
        away = np.where(facing, np.abs(points_m @ planes.normals.T - planes.offsets_m), np.inf)
        plane, held = away.argmin(axis=1), np.flatnonzero(facing.any(axis=1))
        roots = [_root(each) for each in self.turn_covariances]
        for point in held:
            at = plane[point]
            turned = (points_m[point] - self.middles_m[at]) @ roots[at]
            moves[point, at] = [*turned, np.sqrt(self.offset_variances_m2[at])]
        return moves.reshape(len(points_m), -1)


def _root(covariance: Array) -> Array:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def regularise(contacts: WeightedContacts, planes: Planes, *, upright: bool, regular: bool = True) -> RegularPlanes:
    """Rotate planes until they are as regular as the contacts allow.

    Args:
        contacts: contacts of all planes.
        planes: as fitted to them.
        upright: whether the third axis is vertical, so that horizontal and vertical planes are likely.
        regular: whether to look for regularities; otherwise every plane stays unchanged.
    """
    middles, covariance, offset_variances = _uncertainty(contacts, planes)
    log_areas = np.array([_log_angle_area(block) for block in _own_blocks(covariance)])
    none = RegularNormals(planes.normals, covariance, (), 0)
    found = regular_normals(planes.normals, covariance, upright=upright) if regular else none
    offsets = np.sum(found.normals * middles, axis=1)
    chi_square = contacts.chi_squares(found.normals, offsets)[np.arange(len(contacts)), planes.labels].sum()
    turned = Planes(planes.labels, found.normals, offsets, float(chi_square))
    blocks = _own_blocks(found.covariance)
    return RegularPlanes(turned, middles, blocks, offset_variances, log_areas, found.saved)


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
