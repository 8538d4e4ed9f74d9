"""The signed distance from a solid as a field that grasps can be matched with."""

from __future__ import annotations

import numpy as np

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.posterior import Prediction
from tactile_lab.shape.sampling import TriangleMesh, mesh_arrays


class SolidField:
    """Predicts as a :class:`Gpis` does: the distance from a closed surface, negative inside.

    Args:
        mesh: watertight, its triangles counter-clockwise seen from outside.
        sigma_m: standard deviation of the surface along its normal, the same everywhere.
    """

    def __init__(self, mesh: TriangleMesh, sigma_m: float) -> None:
        self._vertices, self._faces = mesh_arrays(mesh)
        self._sigma_m = sigma_m

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        """Distances, and as gradients the normals at the nearest places, at points of shape (q, 3)."""
        import igl  # here, so that importing this module stays quick

        kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        found = igl.signed_distance(np.ascontiguousarray(points_m), self._vertices, self._faces, kind)
        variance_m2 = self.variance(points_m) if variance else np.empty(0)
        return Prediction(np.asarray(found[0]), np.asarray(found[3]) if gradient else np.empty((0, 3)), variance_m2)

    def variance(self, points_m: Array, *, rough: bool = False) -> Array:
        """The surface's variance at points of shape (q, 3), shape (q,); nothing is saved by a rough one."""
        return np.full(len(points_m), self._sigma_m**2)
