"""Ways along the surface: its vertices joined by the edges of its cells."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from tactile_lab.exploration.policy import Surface
from tactile_lab.geometry.contacts import Array


def nearest_vertices(surface: Surface, points_m: Array) -> Array:
    """Index of the vertex nearest to each point, shape (q,)."""
    return np.asarray(cKDTree(surface.points_m).query(points_m)[1])


def path_lengths(surface: Surface, sources: Array) -> Array:
    """Length of the shortest way along the edges from each source vertex to every vertex, shape (k, n), metres.

    Infinite between parts that do not hang together.
    """
    edges = np.vstack([surface.cells[:, [i, j]] for i, j in _sides(surface.cells.shape[1])])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    lengths = np.linalg.norm(surface.points_m[edges[:, 0]] - surface.points_m[edges[:, 1]], axis=1)
    count = len(surface.points_m)
    graph = csr_matrix((np.maximum(lengths, 1e-9), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(dijkstra(graph, directed=False, indices=np.asarray(sources, dtype=int)))


def _sides(corners: int) -> list[tuple[int, int]]:
    return [(0, 1)] if corners == 2 else [(0, 1), (1, 2), (2, 0)]
