"""The surface of a mesh as the physics feels it: convex pieces behind patches of triangles.

The physics collides convex bodies. A few of them that cover a mesh cover its hollows as well: a tin's sunk lid by 4 mm,
a mug's inside by 9, and what a fingertip touches is then not the true surface. Pieces behind the triangles of a
simplified mesh are right everywhere, but a fingertip that touches six of them is pushed by six springs. So neighbours
become one piece as long as their hull fills no place outside the mesh.
"""

from __future__ import annotations

from functools import lru_cache

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.simulation.convex_patches import merge_neighbours

LARGEST_GAP_m = 0.0004
"""Wanted largest distance between a mesh and the surface that is felt: less than half of a contact's error."""

MOST_TRIANGLES = 4000
"""A mesh that is rougher than that is felt as smoother as it is."""

_COUNTS = (400, 550, 750, 1050, 1500, 2050, 2850, MOST_TRIANGLES)
_DEEPEST_m, _FLATTEST_m = 0.004, 0.0002
_SHARE_OF_WALL = 0.45
"""Depth of a piece: those behind both sides of a wall stay inside it."""

_SLIVER_m2 = 1e-9
_SAME_PLACE_m = 1e-5
_SAMPLES = 20_000
_SHARP_rad, _BESIDE_EDGE_m = 0.5, 5e-5
_NEARER = 0.95
"""A place outside that is nearer than this share of its offset lies in a fold of the surface, which may be filled."""


def skin(mesh: trimesh.Trimesh) -> tuple[Array, ...]:
    """Corners of convex pieces behind the surface of a closed mesh, each of shape (n, 3). The same mesh gives the same
    pieces every time.
    """
    return _skin(mesh.vertices.tobytes(), mesh.faces.astype(np.int64).tobytes())


@lru_cache(maxsize=8)
def _skin(vertices: bytes, faces: bytes) -> tuple[Array, ...]:
    given = np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, np.int64).reshape(-1, 3)
    mesh = trimesh.Trimesh(*given, process=False)
    fewer = simplified(mesh)
    felt, inward = _felt(fewer)
    triangles = np.asarray(fewer.triangles)[felt]
    middles = _incentres(triangles)
    depths = np.clip(_SHARE_OF_WALL * _thickness_m(fewer, middles, inward), _FLATTEST_m, _DEEPEST_m)
    behind = middles + depths[:, None] * inward
    pieces = np.concatenate([triangles, behind[:, None]], axis=1)
    return tuple(merge_neighbours(pieces, _neighbours(fewer, felt), _places_outside(mesh)))


def simplified(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A closed mesh with so few triangles as keep it within :data:`LARGEST_GAP_m`, at most :data:`MOST_TRIANGLES`."""
    counts = [count for count in _COUNTS if count < len(mesh.faces)]
    fewer: trimesh.Trimesh | None = None
    while counts:  # halved each time: a mesh of more triangles is nearer
        middle = (len(counts) - 1) // 2
        tried = _decimated(mesh, counts[middle])
        is_near = max(_farthest_m(mesh, tried), _farthest_m(tried, mesh)) < LARGEST_GAP_m
        if is_near or counts[middle] == MOST_TRIANGLES:
            fewer = tried
        counts = counts[:middle] if is_near else counts[middle + 1 :]
    return mesh if fewer is None else fewer


def _decimated(mesh: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    vertices, faces, *_ = igl.qslim(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64), count)
    return trimesh.Trimesh(vertices, faces, process=False)


def _farthest_m(places_of: trimesh.Trimesh, other: trimesh.Trimesh) -> float:
    """Largest distance of samples of one surface from another."""
    return float(_distances_m(trimesh.sample.sample_surface(places_of, _SAMPLES, seed=1)[0], other).max())


def _distances_m(places_m: Array, mesh: trimesh.Trimesh) -> Array:
    squared, *_ = igl.point_mesh_squared_distance(places_m, np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64))
    return np.asarray(np.sqrt(np.asarray(squared)))


def _places_outside(mesh: trimesh.Trimesh) -> Array:
    """Places all around a mesh, :data:`LARGEST_GAP_m` away from it, shape (n, 3)."""
    sides = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=1)
    places_m, faces = map(np.concatenate, zip(sides, _along_sharp_edges(mesh), strict=True))
    away_m = places_m + LARGEST_GAP_m * mesh.face_normals[faces]
    return np.asarray(away_m[_distances_m(away_m, mesh) > _NEARER * LARGEST_GAP_m])


def _along_sharp_edges(mesh: trimesh.Trimesh) -> tuple[Array, NDArray[np.intp]]:
    """Places on both faces at the ends of each sharp edge, shape (n, 3), and the faces, (n,): what is filled at a rim
    is too thin for other places.
    """
    sharp = mesh.face_adjacency_angles > _SHARP_rad
    faces = np.repeat(mesh.face_adjacency[sharp], 2)
    ends_m = mesh.vertices[np.tile(mesh.face_adjacency_edges[sharp], 2).ravel()]
    inside = mesh.triangles_center[faces] - ends_m
    return ends_m + _BESIDE_EDGE_m * inside / np.linalg.norm(inside, axis=1)[:, None], faces


def _felt(mesh: trimesh.Trimesh) -> tuple[NDArray[np.intp], Array]:
    """Indices of the triangles that can be felt, shape (n,), and their inward normals (n, 3)."""
    corners = np.asarray(mesh.triangles)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_m2 = np.linalg.norm(outward, axis=1)
    felt = np.flatnonzero(twice_m2 > 2 * _SLIVER_m2)
    return felt, -outward[felt] / twice_m2[felt, None]


def _neighbours(mesh: trimesh.Trimesh, felt: NDArray[np.intp]) -> NDArray[np.intp]:
    """Pairs of felt triangles with a common edge, as their places among the felt ones, shape (n, 2)."""
    place = np.full(len(mesh.faces), -1)
    place[felt] = np.arange(len(felt))
    pairs = place[mesh.face_adjacency]
    return np.asarray(pairs[(pairs >= 0).all(axis=1)])


def _incentres(triangles: Array) -> Array:
    """Centres of the circles inscribed in triangles (n, 3, 3), shape (n, 3)."""
    opposite = np.linalg.norm(np.roll(triangles, -1, axis=1) - np.roll(triangles, 1, axis=1), axis=2)
    return np.asarray((triangles * opposite[:, :, None]).sum(axis=1) / opposite.sum(axis=1)[:, None])


def _thickness_m(mesh: trimesh.Trimesh, places: Array, inward: Array) -> NDArray[np.float64]:
    """How far it is from places on a surface straight through to its other side, shape (n,)."""
    given = np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64)
    hits = (igl.ray_mesh_intersect(place, way, *given) for place, way in zip(places, inward, strict=True))
    return np.array([min((m for _, m, *_ in found if m > _SAME_PLACE_m), default=np.inf) for found in hits])
