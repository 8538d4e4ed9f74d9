"""The walls of a surface: what of it faces sideways, and how far places are from there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.shape.surfaces.sampling import mesh_arrays
from tactile_lab.slam.shape.surfaces.surface import Indices, Mask, SurfaceMesh

THICKEST_m = 0.010
"""Of walls of a body that is open from above."""

ON_SURFACE_m = 0.006
"""A contact up to so far from a surface may be on it."""

_SIDEWAYS = 0.7
"""Largest vertical part of the normal of a wall."""


@dataclass(frozen=True)
class Walls:
    """Triangles of a surface that face sideways.

    Attributes:
        vertices: of all of the surface, shape (n, 3).
        faces: of the walls alone, shape (m, 3), vertex indices.
    """

    vertices: Array
    faces: Indices

    @classmethod
    def of(cls, mesh: SurfaceMesh) -> Self:
        """All walls of a surface."""
        vertices, faces = mesh_arrays(mesh)
        across = _across(vertices, faces)
        lengths = np.maximum(np.linalg.norm(across, axis=1), np.finfo(float).tiny)
        return cls(vertices, np.ascontiguousarray(faces[np.abs(across[:, 2]) < _SIDEWAYS * lengths]))

    def facing_away(self, middle_m: Array) -> Walls:
        """Those that face away from a place, shape (3,), seen from above."""
        ways = self.middles_m - middle_m
        outward = np.einsum("nk,nk->n", ways[:, :2], _across(self.vertices, self.faces)[:, :2]) > 0
        return self.some(outward)

    def some(self, chosen: Mask) -> Walls:
        """Those of them that are chosen, shape (m,)."""
        return replace(self, faces=np.ascontiguousarray(self.faces[chosen]))

    @property
    def middles_m(self) -> Array:
        """Of the triangles, shape (m, 3)."""
        return np.asarray(self.vertices[self.faces].mean(axis=1))

    def distances_m(self, points_m: Array) -> Array:
        """Of points (q, 3) from the walls, shape (q,); infinite without walls."""
        return self.away(points_m)[0]

    def away(self, points_m: Array) -> tuple[Array, Array]:
        """Distances of points (q, 3) from the walls, shape (q,), and the directions away from them, shape (q, 3)."""
        import igl  # here, so that importing this module stays quick

        if not len(self.faces) or not len(points_m):
            return np.full(len(points_m), np.inf), np.zeros((len(points_m), 3))
        found = igl.point_mesh_squared_distance(np.ascontiguousarray(points_m), self.vertices, self.faces)
        distances_m, nearest_m = np.sqrt(np.atleast_1d(found[0])), np.reshape(found[2], (-1, 3))
        return distances_m, (points_m - nearest_m) / np.maximum(distances_m, 1e-9)[:, None]


def _across(vertices: Array, faces: Indices) -> Array:
    """Outward normals of triangles, as long as twice their areas, shape (m, 3)."""
    corners = vertices[faces]
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
