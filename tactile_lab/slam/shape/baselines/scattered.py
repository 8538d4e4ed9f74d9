"""Common parts of models that connect contacts: averaging close ones, fine meshes, and a sigma by distance."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.slam.shape.baselines.implicit import vertex_normals
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

Patches: TypeAlias = Callable[[Array, Array], Array]

_MERGED_WITHIN_m = 0.005
_MERGED_COSINE = 0.87
_GUESS_SHARE = 0.25
"""Models without probabilities are assumed to be wrong by this share of the distance to the nearest contact."""
_MOST_STEPS = 40


def merge(points_m: Array, normals: Array) -> tuple[Array, Array]:
    """Average contacts with an earlier one within 5 mm and 30 degrees; the order is kept."""
    left, groups = np.ones(len(points_m), dtype=bool), []
    for index, (point, normal) in enumerate(zip(points_m, normals, strict=True)):
        if left[index]:
            near = left & (np.linalg.norm(points_m - point, axis=1) < _MERGED_WITHIN_m)
            near &= normals @ normal > _MERGED_COSINE
            near[index] = True
            left &= ~near
            groups.append(near)
    means = np.array([points_m[group].mean(axis=0) for group in groups])
    directions = np.array([normals[group].sum(axis=0) for group in groups])
    return means, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def distance_sigma(places_m: Array, contacts_m: Array, point_sigma_m: float) -> Array:
    """A guess of the standard deviation at points of shape (n, d): that of contacts, increasing with distance from
    them.
    """
    away, _ = cKDTree(contacts_m).query(places_m)
    return np.asarray(np.hypot(point_sigma_m, _GUESS_SHARE * away))


def along_edges(starts_m: Array, ends_m: Array, curvature: Array, resolution_m: float) -> Array:
    """Points along the edges ``start + (d - c) t + c t^2`` in order, at most this far apart, without their ends."""
    pieces = []
    for start, along, bow in zip(starts_m, ends_m - starts_m, curvature, strict=True):
        count = max(1, int(np.ceil((np.linalg.norm(along) + np.linalg.norm(bow)) / resolution_m)))
        share = (np.arange(count) / count)[:, None]
        pieces.append(start + (along - bow) * share + bow * share**2)
    return np.vstack(pieces)


def patched_mesh(
    corners_m: Array,
    faces: NDArray[np.int64],
    patches: Patches,
    resolution_m: float,
    point_sigma_m: float,
    floor_m: float | None,
) -> SurfaceMesh:
    """Triangles replaced by finely divided patches that meet at their edges.

    Args:
        corners_m: the contacts, shape (n, 3).
        faces: shape (m, 3).
        patches: gives points of all m patches at parameters, ``(0, 0), (1, 0), (1, 1)`` being the corners.
        resolution_m: wanted length of the edges.
        point_sigma_m: standard deviation of the contacts.
        floor_m: vertices below are moved up to this height.
    """
    sides = corners_m[faces] - corners_m[np.roll(faces, 1, axis=1)]
    longest = float(np.linalg.norm(sides, axis=2).max())
    steps = int(np.clip(np.ceil(longest / resolution_m), 1, _MOST_STEPS))
    first, second = np.array([(i, j) for i in range(steps + 1) for j in range(i + 1)]).T
    points = patches(first / steps, second / steps)
    numbers, kept = _shared_numbers(faces, steps, first, second)
    vertices = points.reshape(-1, 3)[kept]
    triangles = numbers[:, _small_triangles(steps)].reshape(-1, 3)
    if floor_m is not None:
        vertices[:, 2] = np.maximum(vertices[:, 2], floor_m)
    sigma = distance_sigma(vertices, corners_m, point_sigma_m)
    return SurfaceMesh(vertices, triangles, sigma, vertex_normals(vertices, triangles), True)


def _small_triangles(steps: int) -> NDArray[np.int64]:
    """Index triples into the points of one patch, counter-clockwise like its corners."""

    def place(i: int, j: int) -> int:
        return i * (i + 1) // 2 + j

    upright = [(place(i, j), place(i + 1, j), place(i + 1, j + 1)) for i in range(steps) for j in range(i + 1)]
    between = [(place(i, j), place(i + 1, j + 1), place(i, j + 1)) for i in range(1, steps) for j in range(i)]
    return np.array(upright + between, dtype=np.int64)


def _shared_numbers(
    faces: NDArray[np.int64], steps: int, first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertex number of each point of each patch, shape (m, q), and of each vertex one of its points.

    A point is identified by its weights on the corners. On a shared edge these are the weights of the edge's two
    corners, in order of the corners' numbers, so they are the same for both patches.
    """
    weights = np.stack([steps - first, first - second, second], axis=1)
    shape = (len(faces), *weights.shape)
    beyond_all = faces.max() + 1
    corners = np.where(weights > 0, np.broadcast_to(faces[:, None, :], shape), beyond_all)
    order = np.argsort(corners, axis=2)
    sorted_weights = np.take_along_axis(np.broadcast_to(weights, shape), order, axis=2)
    keys = np.concatenate([np.take_along_axis(corners, order, axis=2), sorted_weights], axis=2).reshape(-1, 6)
    _, kept, numbers = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return numbers.reshape(len(faces), -1).astype(np.int64), kept.astype(np.int64)
