"""The surface of a mesh as the physics feels it: flat convex pieces, one behind each triangle.

The physics collides convex bodies. A few of them that cover a mesh cover its hollows as well: a tin's sunk lid by 4 mm,
a mug's inside by 9, and what a fingertip touches is then not the true surface. Pieces behind the triangles of a
simplified mesh are right everywhere. They are many, but only few of them are near a finger.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from drivers.core.contacts import Array

LARGEST_GAP_m = 0.0004
"""Wanted largest distance between a mesh and the surface that is felt: less than half of a contact's error."""

MOST_PIECES = 4000
"""A mesh that is rougher than that is felt as smoother as it is."""

_COUNTS = (400, 550, 750, 1050, 1500, 2050, 2850, MOST_PIECES)
_DEEPEST_m, _FLATTEST_m = 0.004, 0.0002
_SHARE_OF_WALL = 0.45
"""Depth of a piece: those behind both sides of a wall stay inside it."""

_SLIVER_m2 = 1e-9
_SAME_PLACE_m = 1e-5
_SAMPLES = 20_000

_PATCHES, _PATCH_m = 150, 0.003
"""Radius of what a fingertip touches, a ball of 8 mm that sinks in by half a millimetre."""


def skin(mesh: trimesh.Trimesh) -> tuple[Array, ...]:
    """Corners of convex pieces behind the surface of a closed mesh, each of shape (4, 3): a triangle of the surface,
    and a point behind it. The same mesh gives the same pieces every time.
    """
    return _skin(mesh.vertices.tobytes(), mesh.faces.astype(np.int64).tobytes())


@lru_cache(maxsize=8)
def _skin(vertices: bytes, faces: bytes) -> tuple[Array, ...]:
    given = np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, np.int64).reshape(-1, 3)
    mesh = simplified(trimesh.Trimesh(*given, process=False))
    triangles, inward = _triangles(mesh)
    middles = _incentres(triangles)
    depths = np.clip(_SHARE_OF_WALL * _thickness_m(mesh, middles, inward), _FLATTEST_m, _DEEPEST_m)
    behind = middles + depths[:, None] * inward
    return tuple(np.concatenate([triangles, behind[:, None]], axis=1))


def pieces_at_once(pieces: Sequence[Array]) -> float:
    """How many pieces of a skin a fingertip touches that sinks in by half a millimetre, mean over the surface."""
    triangles = np.array(pieces)[:, :3]
    middles = triangles.mean(axis=1)
    reach_m = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1) + _PATCH_m
    surface = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)
    touched = []
    for place in trimesh.sample.sample_surface(surface, _PATCHES, seed=1)[0]:
        near = triangles[np.linalg.norm(middles - place, axis=1) < reach_m]
        closest = trimesh.triangles.closest_point(near, np.tile(place, (len(near), 1)))  # type: ignore[no-untyped-call]
        touched.append(np.count_nonzero(np.linalg.norm(closest - place, axis=1) < _PATCH_m))
    return float(np.mean(touched))


def simplified(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A closed mesh with so few triangles as keep it within :data:`LARGEST_GAP_m`, at most :data:`MOST_PIECES`."""
    fewer = mesh
    for count in _COUNTS:
        if count >= len(mesh.faces):
            return mesh
        vertices, faces, *_ = igl.qslim(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64), count)
        fewer = trimesh.Trimesh(vertices, faces, process=False)
        if max(_farthest_m(mesh, fewer), _farthest_m(fewer, mesh)) < LARGEST_GAP_m:
            break
    return fewer


def _farthest_m(places_of: trimesh.Trimesh, other: trimesh.Trimesh) -> float:
    """Largest distance of samples of one surface from another."""
    places_m = trimesh.sample.sample_surface(places_of, _SAMPLES, seed=1)[0]
    found = igl.point_mesh_squared_distance(places_m, np.asarray(other.vertices), np.asarray(other.faces, np.int64))
    return float(np.sqrt(np.max(found[0])))


def _triangles(mesh: trimesh.Trimesh) -> tuple[Array, Array]:
    """Triangles that can be felt, shape (n, 3, 3), and their inward normals (n, 3)."""
    corners = np.asarray(mesh.triangles)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_m2 = np.linalg.norm(outward, axis=1)
    felt = twice_m2 > 2 * _SLIVER_m2
    return corners[felt], -outward[felt] / twice_m2[felt, None]


def _incentres(triangles: Array) -> Array:
    """Centres of the circles inscribed in triangles (n, 3, 3), shape (n, 3)."""
    opposite = np.linalg.norm(np.roll(triangles, -1, axis=1) - np.roll(triangles, 1, axis=1), axis=2)
    return np.asarray((triangles * opposite[:, :, None]).sum(axis=1) / opposite.sum(axis=1)[:, None])


def _thickness_m(mesh: trimesh.Trimesh, places: Array, inward: Array) -> NDArray[np.float64]:
    """How far it is from places on a surface straight through to its other side, shape (n,)."""
    given = np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64)
    hits = (igl.ray_mesh_intersect(place, way, *given) for place, way in zip(places, inward, strict=True))
    return np.array([min((m for _, m, *_ in found if m > _SAME_PLACE_m), default=np.inf) for found in hits])
