"""A top that was touched near its edge alone: a body that is open there explains every contact as well as a lid does.

Contacts on a rim are level and at one height, which a flat top explains best: its standard deviation is half a
millimetre across the whole opening. A lid is known only where a contact is farther from the walls than the wall of any
vessel is thick. What a finger was inside of is open (:mod:`tactile_lab.slam.shape.solids.hollow`), and no matter here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.shape.solids.walls import ON_SURFACE_m, THICKEST_m, Walls
from tactile_lab.slam.shape.surfaces.surface import Mask, SurfaceMesh

_UPWARD = 0.7
"""Least vertical part of the normal of a top."""

_SUNK = -0.05
"""Least rise from the nearest wall to a place on a top, for its distance: from a floor walls go up."""

_LID_m = THICKEST_m + ON_SURFACE_m
"""Farther from the walls no contact is on the rim of a vessel."""

_FINGERTIP_m = 0.0085
"""Its radius: of a narrower top no finger tells whether there is a lid."""


def unfelt_top(mesh: SurfaceMesh, points_m: Array, normals: Array, near: Mask) -> Mask:
    """The vertices of tops that may as well be openings, shape (n,).

    Args:
        mesh: the surface of an object that stands on the table, object frame.
        points_m, normals: of the contacts, shape (k, 3) each, object frame.
        near: which vertices would count as touched, shape (n,); a top without any is a guess anyway.
    """
    walls = Walls.of(mesh)
    away_m, ways = walls.away(mesh.vertices)
    away_m = np.where((mesh.normals[:, 2] > _UPWARD) & (ways[:, 2] > _SUNK), away_m, 0.0)
    inner = away_m > THICKEST_m
    parts = _connected(mesh, inner)
    on_lid = points_m[(normals[:, 2] > _UPWARD) & (walls.distances_m(points_m) > _LID_m)]
    wide = np.intersect1d(parts[away_m > _LID_m + _FINGERTIP_m], parts[inner & near])
    return inner & np.isin(parts, np.setdiff1d(wide, _touched(mesh.vertices, parts, inner, on_lid)))


def _connected(mesh: SurfaceMesh, chosen: Mask) -> NDArray[np.int32]:
    """Of each vertex the number of the part that it is in, shape (n,); parts are those of the chosen vertices alone."""
    edges = np.vstack([mesh.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    edges, count = edges[chosen[edges].all(axis=1)], len(mesh.vertices)
    graph = csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _touched(vertices: Array, parts: NDArray[np.int32], inner: Mask, points_m: Array) -> NDArray[np.int32]:
    """The parts that contacts, shape (k, 3), are on."""
    if not inner.any() or not len(points_m):
        return np.empty(0, dtype=np.int32)
    gaps_m, nearest = cKDTree(vertices[inner]).query(points_m)
    return np.unique(parts[inner][np.asarray(nearest)[gaps_m < ON_SURFACE_m]])


def doubts_of_top(mesh: SurfaceMesh, unfelt: Mask) -> list[Doubt]:
    """A doubt if some of a surface's tops, given by its vertices, shape (n,), may as well be an opening."""
    if not unfelt.any():
        return []
    one, other = sorted(1e3 * np.ptp(mesh.vertices[unfelt, :2], axis=0))
    words = (
        f"its top was touched no farther than {1e3 * _LID_m:.0f} mm from its edge: it may be open there, over about "
        f"{other:.0f} x {one:.0f} mm"
    )
    return [Doubt("unfelt-top", words, grave=False)]
