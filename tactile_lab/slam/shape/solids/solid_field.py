"""The signed distance from a solid as a field, so that grasps can be matched with it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.surfaces.sampling import TriangleMesh, mesh_arrays

_MARGIN_m, _FINEST_m, _NODES = 0.015, 0.002, 150_000


class SolidField:
    """Predicts as a :class:`Gpis` does: the distance from a closed surface, negative inside.

    Args:
        mesh: watertight, its triangles counter-clockwise seen from outside.
        sigma_m: standard deviation of the surface along its normal, the same everywhere or of each vertex, shape (n,).
    """

    def __init__(self, mesh: TriangleMesh, sigma_m: float | Array) -> None:
        self._vertices, self._faces = mesh_arrays(mesh)
        self._sigma_m = np.asarray(sigma_m)

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """Distances at points of shape (q, 3); gradients are the normals at the nearest points of the surface."""
        import igl  # here, so that importing this module stays quick

        kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        points_m = np.ascontiguousarray(points_m)
        found = igl.signed_distance(points_m, self._vertices, self._faces, kind)
        distances_m, nearest_m, normals = (np.asarray(found[part]) for part in (0, 2, 3))
        # at a fold of the surface the normals of both sides cancel each other: that point has neither sign nor normal
        if (folded := ~np.isfinite(normals).all(axis=1)).any():
            seen = self._across(points_m[folded], nearest_m[folded])
            distances_m[folded], normals[folded] = seen
        variance_m2 = self.variance(points_m) if variance else np.empty(0)
        return Prediction(distances_m, normals if gradient else np.empty((0, 3)), variance_m2)

    def _across(self, points_m: Array, nearest_m: Array) -> tuple[Array, Array]:
        """Signed distances by the winding number, shape (q,), and directions away from the inside, shape (q, 3)."""
        import igl

        inside = np.asarray(igl.winding_number(self._vertices, self._faces, points_m)).ravel() > 0.5
        away = np.where(inside[:, None], nearest_m - points_m, points_m - nearest_m)
        lengths_m = np.linalg.norm(away, axis=1)
        return np.where(inside, -lengths_m, lengths_m), away / np.maximum(lengths_m, 1e-12)[:, None]

    def variance(self, points_m: Array, *, rough: bool = False) -> Array:
        """The surface's variance at points of shape (q, 3), shape (q,); ``rough`` has no effect."""
        if self._sigma_m.ndim == 0:
            return np.full(len(points_m), float(self._sigma_m) ** 2)
        return np.asarray(self._sigma_m[cKDTree(self._vertices).query(points_m)[1]] ** 2)


class TabulatedSolid:
    """A solid's field tabulated on a grid: twenty times faster to evaluate at some hundred points, and quick to make.

    Edges are rounded by the spacing of the nodes: 2 mm for objects within a hand's span, more for larger ones.

    Args:
        mesh, sigma_m: as for :class:`SolidField`.
    """

    def __init__(self, mesh: TriangleMesh, sigma_m: float) -> None:
        self._solid, vertices = SolidField(mesh, sigma_m), np.asarray(mesh.vertices)
        lower_m, upper_m = vertices.min(axis=0) - _MARGIN_m, vertices.max(axis=0) + _MARGIN_m
        spacing_m = max(_FINEST_m, float(np.cbrt(np.prod(upper_m - lower_m) / _NODES)))
        self._grid = FieldGrid.tabulate(self._solid, lower_m, upper_m, spacing_m, gradient=True)

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """As :meth:`SolidField.predict`; beyond the grid the distance to the grid is added."""
        found = self._grid.predict(points_m, gradient=gradient)
        return Prediction(found.mean_m, found.gradient, self.variance(points_m) if variance else np.empty(0))

    def variance(self, points_m: Array, *, rough: bool = False) -> Array:
        """As :meth:`SolidField.variance`."""
        return self._solid.variance(points_m, rough=rough)
