"""Uniform, reproducible samples of contours and meshes, and exact distances to them."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from drivers.core.contacts import Array

_PAIRS_AT_ONCE = 1 << 20


class TriangleMesh(Protocol):
    """The required interface of a mesh; :class:`SurfaceMesh` and trimesh's own meshes have it."""

    @property
    def vertices(self) -> Any:
        """Shape (n, 3), metres."""

    @property
    def faces(self) -> Any:
        """Shape (m, 3), vertex indices, counter-clockwise seen from outside."""


def polygon_area(polygon_m: Array) -> float:
    """Area within a closed polygon of shape (n, 2), positive if it is counter-clockwise."""
    following = np.roll(polygon_m, -1, axis=0)
    return 0.5 * float(np.sum(polygon_m[:, 0] * following[:, 1] - polygon_m[:, 1] * following[:, 0]))


def sample_polygon(polygon_m: Array, step_m: float) -> Array:
    """Points along a closed polygon of shape (n, 2), evenly spaced by at most ``step_m``."""
    closed = np.vstack([polygon_m, polygon_m[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    places = np.linspace(0.0, along[-1], int(np.ceil(along[-1] / step_m)) + 1)[:-1]
    return np.column_stack([np.interp(places, along, closed[:, axis]) for axis in (0, 1)])


def sample_polygon_with_values(polygon_m: Array, values: Array, step_m: float) -> tuple[Array, Array]:
    """As :func:`sample_polygon`, and values given at the corners, shape (n,), interpolated there."""
    closed, given = np.vstack([polygon_m, polygon_m[:1]]), np.append(values, values[0])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    points = sample_polygon(polygon_m, step_m)
    places = np.linspace(0.0, along[-1], len(points) + 1)[:-1]
    return points, np.interp(places, along, given)


def sample_mesh(mesh: TriangleMesh, count: int, seed: int = 0) -> Array:
    """Points spread over the surface of a mesh in proportion to area, shape (count, 3); the same for the same seed."""
    return sample_mesh_with_normals(mesh, count, seed)[0]


def sample_mesh_with_normals(mesh: TriangleMesh, count: int, seed: int = 0) -> tuple[Array, Array]:
    """As :func:`sample_mesh`, and the unit normals of the faces there."""
    corners = np.asarray(mesh.vertices, dtype=float)[np.asarray(mesh.faces)]
    first_edges, second_edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(first_edges, second_edges)
    doubled_areas = np.linalg.norm(normals, axis=1)
    face, first, second = _places_on_faces(doubled_areas, count, seed)
    points = corners[face, 0] + first * first_edges[face] + second * second_edges[face]
    return points, normals[face] / doubled_areas[face, None]


def sample_mesh_with_values(mesh: TriangleMesh, values: Array, count: int, seed: int = 0) -> tuple[Array, Array]:
    """As :func:`sample_mesh`, and values given at the vertices, shape (n,), interpolated there, shape (count,)."""
    vertices, faces = mesh_arrays(mesh)
    corners, given = vertices[faces], np.asarray(values, dtype=float)[faces]
    first_edges, second_edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    face, first, second = _places_on_faces(np.linalg.norm(np.cross(first_edges, second_edges), axis=1), count, seed)
    points = corners[face, 0] + first * first_edges[face] + second * second_edges[face]
    shares = np.hstack([1 - first - second, first, second])
    return points, np.asarray(np.sum(shares * given[face], axis=1))


def _places_on_faces(areas: Array, count: int, seed: int) -> tuple[Any, Array, Array]:
    """Faces, and steps along their two edges as shares of shape (count, 1), evenly spread in proportion to area."""
    rng, shares = np.random.default_rng(seed), np.cumsum(areas)
    stratified = (np.arange(count) + rng.random(count)) / count * shares[-1]
    face = np.minimum(np.searchsorted(shares, stratified, side="right"), len(shares) - 1)
    first, second = rng.random((2, count, 1))
    folded = first + second > 1
    return face, np.where(folded, 1 - first, first), np.where(folded, 1 - second, second)


def distances_to_polygon(points_m: Array, polygon_m: Array) -> Array:
    """Exact distances from points of shape (q, 2) to the outline of a closed polygon of shape (n, 2)."""
    size = max(1, _PAIRS_AT_ONCE // len(polygon_m))
    blocks = [distances_to_sides(points_m[i : i + size], polygon_m) for i in range(0, len(points_m), size)]
    return np.concatenate([block.min(axis=1) for block in blocks])


def distances_to_sides(points_m: Array, polygon_m: Array) -> Array:
    """Exact distances, shape (q, n), from points of shape (q, 2) to each side of a closed polygon of shape (n, 2)."""
    starts_x, starts_y = polygon_m.T
    edges_x, edges_y = (np.roll(polygon_m, -1, axis=0) - polygon_m).T
    squared_lengths = np.maximum(edges_x**2 + edges_y**2, np.finfo(float).tiny)
    from_x, from_y = points_m[:, :1] - starts_x, points_m[:, 1:] - starts_y
    share = np.clip((from_x * edges_x + from_y * edges_y) / squared_lengths, 0.0, 1.0)
    return np.asarray(np.hypot(from_x - share * edges_x, from_y - share * edges_y))


def distances_to_mesh(points_m: Array, mesh: TriangleMesh) -> Array:
    """Exact distances from points of shape (q, 3) to the surface of a mesh."""
    return nearest_on_mesh(points_m, mesh)[0]


class MeshDistances:
    """Exact distances to the surface of one mesh, asked for again and again: it is searched through a tree that is
    made once.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        import igl  # here, so that importing this module stays quick

        self._vertices, self._faces = mesh_arrays(mesh)
        self._tree = igl.AABB()
        self._tree.init(self._vertices, self._faces)

    def of(self, points_m: Array) -> Array:
        """Of points of shape (q, 3), shape (q,)."""
        squared = self._tree.squared_distance(self._vertices, self._faces, np.ascontiguousarray(points_m))[0]
        return np.asarray(np.sqrt(squared), dtype=float)


def nearest_on_mesh(points_m: Array, mesh: TriangleMesh) -> tuple[Array, Array]:
    """Exact distances from points of shape (q, 3) to the surface of a mesh, and its nearest points, shape (q, 3)."""
    import igl  # here, so that importing this module stays quick

    vertices, faces = mesh_arrays(mesh)
    squared, _, places = igl.point_mesh_squared_distance(np.ascontiguousarray(points_m), vertices, faces)
    return np.asarray(np.sqrt(squared), dtype=float), np.asarray(places, dtype=float)


def mesh_arrays(mesh: TriangleMesh) -> tuple[Array, Any]:
    """Vertices and faces as contiguous arrays of float64 and int64."""
    return np.ascontiguousarray(mesh.vertices, dtype=float), np.ascontiguousarray(mesh.faces, dtype=np.int64)
