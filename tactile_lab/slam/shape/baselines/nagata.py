"""Nagata patches (eq. 2.2): quadratic curves and triangles through contacts that respect their normals.

Each edge between two contacts becomes the quadratic curve that is tangent to both contacts' planes; the coefficients of
a triangle's patch follow from its three edges (Nagata 2005). The thesis leaves open how contacts are joined: in the
plane in their order along an outline, in space by the convex hull of their directions from the middle. Contacts within
a few millimetres of each other are averaged, because noise would cause folds there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.baselines.scattered import along_edges, distance_sigma, merge, patched_mesh
from tactile_lab.slam.shape.planar.outlines import is_simple
from tactile_lab.slam.shape.surfaces.sampling import polygon_area
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

LARGEST_BULGE = 0.22
"""Largest bulge of an edge relative to its length; a larger one would come from a wrong normal, and the edge stays
straight.
"""

_PARALLEL = 1e-9


def edge_curvature(starts_m: Array, ends_m: Array, start_normals: Array, end_normals: Array) -> Array:
    """The coefficient c of ``start + (d - c) t + c t^2`` for each edge, d being ``end - start``; shape (n, k).

    The smallest c that makes the curve tangent to the planes at both ends.
    """
    along = ends_m - starts_m
    cosine = np.sum(start_normals * end_normals, axis=1)
    at_start, at_end = np.sum(start_normals * along, axis=1), -np.sum(end_normals * along, axis=1)
    determinant = 1 - cosine**2
    curved = determinant > _PARALLEL
    safe = np.where(curved, determinant, 1.0)
    first, second = (at_start - cosine * at_end) / safe, (at_end - cosine * at_start) / safe
    curvature = first[:, None] * start_normals + second[:, None] * end_normals
    bulge = np.linalg.norm(curvature, axis=1) / 4
    tame = curved & (bulge <= LARGEST_BULGE * np.linalg.norm(along, axis=1))
    return np.asarray(np.where(tame[:, None], curvature, 0.0))


def patch_points(corners_m: Array, normals: Array, eta: Array, zeta: Array) -> Array:
    """Points of triangular patches (2.2) at the same parameters on each, ``0 <= zeta <= eta <= 1``.

    Args:
        corners_m: shape (n, 3, 3), counter-clockwise seen from outside.
        normals: at the corners, shape (n, 3, 3).
        eta, zeta: parameters, shape (q,); (0, 0), (1, 0) and (1, 1) are the corners.

    Returns:
        Shape (n, q, 3).
    """
    x00, x10, x11 = corners_m[:, 0], corners_m[:, 1], corners_m[:, 2]
    c1 = edge_curvature(x00, x10, normals[:, 0], normals[:, 1])
    c2 = edge_curvature(x10, x11, normals[:, 1], normals[:, 2])
    c3 = edge_curvature(x00, x11, normals[:, 0], normals[:, 2])
    coefficients = np.stack([x00, x10 - x00 - c1, x11 - x10 + c1 - c3, c3 - c1 - c2, c1, c2], axis=1)
    powers = np.stack([np.ones_like(eta), eta, zeta, eta * zeta, eta**2, zeta**2], axis=1)
    return np.asarray(np.einsum("qk,nkd->nqd", powers, coefficients))


@dataclass(frozen=True)
class NagataShape:
    """Contacts connected by Nagata curves or patches; a :class:`FittedShape` without evidence.

    Attributes:
        points_m: contacts, close ones averaged; in the plane in counter-clockwise order; shape (n, d).
        normals: shape (n, d).
        point_sigma_m: mean standard deviation of the contacts.
        faces: triangles of the contacts in space, shape (m, 3); empty in the plane.
    """

    points_m: Array
    normals: Array
    point_sigma_m: float
    faces: NDArray[np.int64]
    name: str = "nagata"
    log_evidence: None = None

    @classmethod
    def of(
        cls, points_m: Array, normals: Array, point_sigma_m: Array, order: NDArray[np.int64] | None = None
    ) -> NagataShape:
        """Join contacts of shape (n, d).

        Args:
            points_m, normals: contacts.
            point_sigma_m: shape (n,).
            order: counter-clockwise order along the outline, in the plane; by the angle from the middle if None.

        Raises:
            ShapeError: too few contacts, or they do not surround the object.
        """
        if points_m.shape[1] == 2:
            order = _by_angle(points_m) if order is None else order
            points_m, normals = points_m[order], normals[order]
        points_m, normals = merge(points_m, normals)
        planar = points_m.shape[1] == 2
        faces = np.empty((0, 3), dtype=np.int64) if planar else _triangulate(points_m)
        if planar and (len(points_m) < 3 or polygon_area(points_m) <= 0):
            raise ShapeError("the contacts enclose nothing", hint="Contacts on three sides are needed")
        return cls(points_m, normals, float(point_sigma_m.mean()), faces)

    def contour(self, resolution_m: float = 0.001) -> Contour:
        if self.points_m.shape[1] != 2:
            raise ShapeError("contacts in space have a surface, no outline")
        following, next_normals = np.roll(self.points_m, -1, axis=0), np.roll(self.normals, -1, axis=0)
        bows = edge_curvature(self.points_m, following, self.normals, next_normals)
        for curvature in (bows, np.zeros_like(bows)):
            points = along_edges(self.points_m, following, curvature, resolution_m)
            if polygon_area(points) > 0 and is_simple(points):
                return Contour(points, distance_sigma(points, self.points_m, self.point_sigma_m), True)
        raise ShapeError("the curves through the contacts cross each other", hint="Contacts in better order are needed")

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        if self.points_m.shape[1] != 3:
            raise ShapeError("contacts in the plane have no surface")
        corners, normals = self.points_m[self.faces], self.normals[self.faces]
        return patched_mesh(
            self.points_m,
            self.faces,
            lambda eta, zeta: patch_points(corners, normals, eta, zeta),
            resolution_m,
            self.point_sigma_m,
            floor_m,
        )


def _by_angle(points_m: Array) -> NDArray[np.int64]:
    offset = points_m - (points_m.min(axis=0) + points_m.max(axis=0)) / 2
    return np.argsort(np.arctan2(offset[:, 1], offset[:, 0]), kind="stable")


def _triangulate(points_m: Array) -> NDArray[np.int64]:
    """Triangulation of the contacts as seen from the middle, counter-clockwise from outside; every contact is a
    corner.
    """
    middle = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
    offset = points_m - middle
    distance = np.linalg.norm(offset, axis=1, keepdims=True)
    try:
        hull = ConvexHull(offset / np.maximum(distance, 1e-9))
    except (QhullError, ValueError) as error:
        raise ShapeError("the contacts enclose nothing", hint="Contacts on four sides are needed") from error
    if hull.equations[:, -1].max() > -0.05:
        raise ShapeError("the contacts are all on one side of the object", hint="Contacts on all sides are needed")
    faces = hull.simplices.astype(np.int64)
    corners = hull.points[faces]
    inward = np.linalg.det(corners) < 0
    faces[inward] = faces[inward][:, ::-1]
    return np.asarray(faces)
