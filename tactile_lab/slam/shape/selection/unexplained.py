"""Contacts far outside or inside of a surface, in groups: one may be wrong, several near each other tell of a part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.sampling import TriangleMesh, distances_to_mesh, mesh_arrays


@dataclass(frozen=True)
class Unexplained:
    """Contacts near each other that a surface does not explain, or a single one.

    Attributes:
        members: their indices.
        farthest_m: largest of their distances from the surface.
        is_inside: whether the surface encloses them.
    """

    members: NDArray[np.intp]
    farthest_m: float
    is_inside: bool


def unexplained(points_m: Array, mesh: TriangleMesh, *, far_m: float, together_m: float) -> list[Unexplained]:
    """Groups of contacts farther than ``far_m`` from a surface, each no farther than ``together_m`` from the next.

    Args:
        points_m: of all contacts, shape (n, 3), in the frame of the surface.
        mesh: the surface, watertight.
        far_m, together_m: see above.
    """
    if not len(points_m):
        return []
    away_m = distances_to_mesh(points_m, mesh)
    far = np.flatnonzero(away_m > far_m)
    inside = are_inside(points_m[far], mesh)
    return [
        Unexplained(group, float(away_m[group].max()), is_inside)
        for is_inside in (False, True)
        for group in _groups(points_m, far[inside == is_inside], together_m)
    ]


def are_inside(points_m: Array, mesh: TriangleMesh) -> NDArray[np.bool_]:
    """Which points of shape (n, 3) a watertight surface encloses."""
    import igl  # here, so that importing this module stays quick

    if not len(points_m):
        return np.zeros(0, dtype=bool)
    return np.asarray(igl.fast_winding_number(*mesh_arrays(mesh), np.ascontiguousarray(points_m)) > 0.5)


def _groups(points_m: Array, chosen: NDArray[np.intp], together_m: float) -> list[NDArray[np.intp]]:
    if len(chosen) < 2:
        return [chosen] if len(chosen) else []
    labels = fcluster(linkage(points_m[chosen], "single"), together_m, "distance")
    return [chosen[labels == label] for label in np.unique(labels)]
