"""The contacts themselves as the shape: the tightest hull of simplices that contains all of them in one body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.baselines.scattered import along_edges, distance_sigma, merge, patched_mesh
from tactile_lab.slam.shape.surfaces.sampling import polygon_area
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_TRIES = 60
_AMPLE = 1.5
"""Radius relative to the smallest possible one, which would cut into the body between sparse contacts."""


@dataclass(frozen=True)
class PointCloudShape:
    """An alpha shape as a :class:`FittedShape`; its radius is 1.5 times the smallest that keeps all contacts in one
    body.

    Normals are not used, and there is no evidence.

    Attributes:
        points_m: contacts, close ones averaged, shape (n, d).
        facets: edges (k, 2) or triangles (k, 3) of the hull, facing outwards.
        point_sigma_m: mean standard deviation of the contacts.
    """

    points_m: Array
    facets: NDArray[np.int64]
    point_sigma_m: float
    name: str = "point-cloud"
    log_evidence: None = None

    @classmethod
    def of(cls, points_m: Array, normals: Array, point_sigma_m: Array) -> PointCloudShape:
        """The hull of contacts of shape (n, d). Raises ShapeError if they enclose nothing."""
        points_m, _ = merge(points_m, normals)
        try:
            simplices = Delaunay(points_m).simplices.astype(np.int64)
        except (QhullError, ValueError) as error:
            raise ShapeError("the contacts enclose nothing", hint="Contacts on more sides are needed") from error
        radii = _circumradii(points_m[simplices])
        tries = np.quantile(radii, np.linspace(0, 1, _TRIES), method="higher")
        hulls = [(radius, _boundary(points_m, simplices[radii <= radius])) for radius in tries]
        clean = [(radius, facets) for radius, facets in hulls if facets is not None]
        if clean:
            ample = [facets for radius, facets in clean if radius >= _AMPLE * clean[0][0]]
            return cls(points_m, ample[0] if ample else clean[-1][1], float(point_sigma_m.mean()))
        raise ShapeError("the contacts do not form one body", hint="More contacts are needed")

    def contour(self, resolution_m: float = 0.001) -> Contour:
        if self.points_m.shape[1] != 2:
            raise ShapeError("contacts in space have a surface, no outline")
        corners = self.points_m[_loop(self.facets)]
        corners = corners if polygon_area(corners) > 0 else corners[::-1]
        points = along_edges(corners, np.roll(corners, -1, axis=0), np.zeros_like(corners), resolution_m)
        return Contour(points, distance_sigma(points, self.points_m, self.point_sigma_m), True)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        if self.points_m.shape[1] != 3:
            raise ShapeError("contacts in the plane have no surface")
        first, second, third = (self.points_m[self.facets[:, k], None, :] for k in range(3))

        def flat(eta: Array, zeta: Array) -> Array:
            return np.asarray(first + eta[:, None] * (second - first) + zeta[:, None] * (third - second))

        return patched_mesh(self.points_m, self.facets, flat, resolution_m, self.point_sigma_m, floor_m)


def _circumradii(corners_m: Array) -> Array:
    """Radius of the circle or sphere through the corners of each simplex; infinite for flat ones."""
    edges = corners_m[:, 1:] - corners_m[:, :1]
    flat = np.abs(np.linalg.det(edges)) < 1e-15
    edges = np.where(flat[:, None, None], np.eye(edges.shape[2]), edges)
    centres = np.linalg.solve(edges, 0.5 * np.sum(edges**2, axis=2)[..., None])[..., 0]
    return np.where(flat, np.inf, np.linalg.norm(centres, axis=1))


def _boundary(points_m: Array, simplices: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """The outer facets of a body of simplices with all points in it; None if it has several parts, or is pinched."""
    if len(np.unique(simplices)) < len(points_m):
        return None
    corner_count = simplices.shape[1]
    facets = np.concatenate([np.delete(simplices, left, axis=1) for left in range(corner_count)])
    opposite = np.concatenate([simplices[:, left] for left in range(corner_count)])
    owner = np.tile(np.arange(len(simplices)), corner_count)
    _, where, uses = np.unique(np.sort(facets, axis=1), axis=0, return_inverse=True, return_counts=True)
    where = where.ravel()
    if not _one_body(owner, where, uses, len(simplices)):
        return None
    outer = uses[where] == 1
    found = _facing_outwards(points_m, facets[outer], opposite[outer])
    return found if _is_clean(found) else None


def _one_body(owner: NDArray[np.int64], where: NDArray[np.int64], uses: NDArray[np.int64], count: int) -> bool:
    """Whether all simplices are connected by shared facets."""
    shared = np.flatnonzero(uses[where] == 2)
    pairs = owner[shared[np.argsort(where[shared], kind="stable")]].reshape(-1, 2)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return int(connected_components(links, directed=False)[0]) == 1


def _facing_outwards(points_m: Array, facets: NDArray[np.int64], opposite: NDArray[np.int64]) -> NDArray[np.int64]:
    inward = points_m[opposite] - points_m[facets[:, 0]]
    sides = points_m[facets[:, 1:]] - points_m[facets[:, :1]]
    turned = np.linalg.det(np.concatenate([sides, inward[:, None]], axis=1)) > 0
    facets = facets.copy()
    facets[turned] = facets[turned][:, ::-1]
    return facets


def _is_clean(facets: NDArray[np.int64]) -> bool:
    """Whether each ridge (corner in the plane, edge in space) belongs to two facets, and all facets are connected."""
    corner_count = facets.shape[1]
    ridges = np.concatenate([np.delete(facets, left, axis=1) for left in range(corner_count)])
    owner = np.tile(np.arange(len(facets)), corner_count)
    _, where, uses = np.unique(np.sort(ridges, axis=1), axis=0, return_inverse=True, return_counts=True)
    return bool((uses == 2).all()) and _one_body(owner, where.ravel(), uses, len(facets))


def _loop(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """The corners of a closed line of edges, one after another."""
    neighbours: dict[int, list[int]] = {}
    for first, second in edges.tolist():
        neighbours.setdefault(first, []).append(second)
        neighbours.setdefault(second, []).append(first)
    loop = [int(edges[0, 0]), int(edges[0, 1])]
    while len(loop) < len(edges):
        one, other = neighbours[loop[-1]]
        loop.append(other if one == loop[-2] else one)
    return np.array(loop, dtype=np.int64)
