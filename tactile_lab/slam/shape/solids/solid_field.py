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
        found = igl.signed_distance(np.ascontiguousarray(points_m), self._vertices, self._faces, kind)
        variance_m2 = self.variance(points_m) if variance else np.empty(0)
        return Prediction(np.asarray(found[0]), np.asarray(found[3]) if gradient else np.empty((0, 3)), variance_m2)

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
