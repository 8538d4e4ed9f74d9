"""Observability of a relative pose by a set of contacts (thesis section 3.3.2).

Point-to-plane matching is linearised (3.10-3.15): each contact contributes a row
``H_i = [-(p_i x n_i)^T, -n_i^T]`` (3.17), and the eigenvalues of ``A = sum H_i^T H_i`` (3.18) show which motions the
contacts resist. As printed the rotation part carries metres squared and the others none, so the eigenvalues depend on
the unit and on the origin. Here points are taken about their centre and divided by a length: the eigenvalues are then
pure numbers, comparable among each other, and one contact adds at most one for each direction it resists.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array

SCALE_m = 0.030
"""Length that scales the lever arms: about half the size of an object that fits into the hand."""


@dataclass(frozen=True)
class Observability:
    """Observability of small motions by contacts.

    Attributes:
        eigenvalues: of (3.18), ascending, without unit.
        weakest_direction: unit eigenvector of the smallest: rotation (1 or 3 components, times
            ``SCALE_m``) before translation (2 or 3), about the centre of the contacts.
    """

    eigenvalues: Array
    weakest_direction: Array

    @property
    def smallest(self) -> float:
        return float(self.eigenvalues[0])


def jacobian(points_m: Array, normals: Array, scale_m: float = SCALE_m) -> Array:
    """Rows ``H_i`` of (3.17) for contacts of shape (n, d), lengths scaled, shape (n, 3) or (n, 6)."""
    arms = (points_m - points_m.mean(axis=0)) / scale_m
    if points_m.shape[1] == 2:
        turns = (arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0])[:, None]
    else:
        turns = np.cross(arms, normals)
    return -np.hstack([turns, normals])


def observability(points_m: Array, normals: Array, scale_m: float = SCALE_m) -> Observability:
    """Eigenvalues of (3.18) for motions of all degrees of freedom: 3 in the plane, 6 in space.

    Args:
        points_m: shape (n, d), at least one contact.
        normals: unit normals, shape (n, d).
        scale_m: length that makes rotations comparable with translations.
    """
    rows = jacobian(points_m, normals, scale_m)
    values, vectors = np.linalg.eigh(rows.T @ rows)
    return Observability(np.maximum(values, 0.0), vectors[:, 0])


def planar_observability(points_m: Array, normals: Array, scale_m: float = SCALE_m) -> Observability:
    """The same for an object that only moves on the table, from contacts in the plane or in space."""
    return observability(points_m[:, :2], normals[:, :2], scale_m)
