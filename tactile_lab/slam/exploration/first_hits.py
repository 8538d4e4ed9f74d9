"""Where rays first meet a polygon or a triangle mesh, compiled: many rays, many slightly different surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.compiled import compile_when_called

_PARALLEL = 1e-14
_BLOCK = 24
"""Successive triangles with a common bounding sphere: in an extracted mesh they are neighbours."""


@compile_when_called
def hits_on_outlines(corners: Any, starts: Any, ways: Any, longest: Any) -> Any:
    """Of rays with the outline of their own sample.

    Args:
        corners: closed outlines, shape (s, n, 2); the last corner joins the first.
        starts, ways: rays, shape (s, r, 2).
        longest: shape (r,).

    Returns:
        Distances along the rays, shape (s, r); infinite if nothing is hit.
    """
    samples, count = starts.shape[0], starts.shape[1]
    found = np.full((samples, count), np.inf)
    for s in range(samples):
        for r in range(count):
            x, y, u, v = starts[s, r, 0], starts[s, r, 1], ways[s, r, 0], ways[s, r, 1]
            best = longest[r]
            last = corners.shape[1] - 1
            for i in range(corners.shape[1]):
                ax, ay = corners[s, last, 0] - x, corners[s, last, 1] - y
                ex, ey = corners[s, i, 0] - x - ax, corners[s, i, 1] - y - ay
                last = i
                across = u * ey - v * ex
                if abs(across) < _PARALLEL:
                    continue
                along = (ax * ey - ay * ex) / across
                part = (ax * v - ay * u) / across
                if 0.0 < along < best and 0.0 <= part <= 1.0:
                    best = along
                    found[s, r] = along
    return found


@compile_when_called
def bounding_spheres(vertices: Any, faces: Any) -> Any:
    """Middles and squared radii of triangles, shape (m, 4)."""
    spheres = np.zeros((faces.shape[0], 4))
    for m in range(faces.shape[0]):
        for corner in range(3):
            for axis in range(3):
                spheres[m, axis] += vertices[faces[m, corner], axis] / 3.0
        for corner in range(3):
            squared = np.sum((vertices[faces[m, corner]] - spheres[m, :3]) ** 2)
            spheres[m, 3] = max(spheres[m, 3], squared)
    return spheres


@compile_when_called
def spheres_of_blocks(spheres: Any) -> Any:
    """Spheres around this many successive ones each, shape (b, 4)."""
    blocks = np.zeros(((spheres.shape[0] + _BLOCK - 1) // _BLOCK, 4))
    for b in range(blocks.shape[0]):
        own = spheres[b * _BLOCK : (b + 1) * _BLOCK]
        for axis in range(3):
            blocks[b, axis] = np.mean(own[:, axis])
        for s in range(own.shape[0]):
            radius = np.sqrt(np.sum((own[s, :3] - blocks[b, :3]) ** 2)) + np.sqrt(own[s, 3])
            blocks[b, 3] = max(blocks[b, 3], (1.0 + 1e-9) * radius * radius)
    return blocks


@compile_when_called
def crossing(p: Any, q: Any, r: Any, start: Any, way: Any) -> Any:
    """Distance along a ray to a triangle that it meets from outside (Moeller and Trumbore 1997), -1 for none."""
    ex, ey, ez = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    fx, fy, fz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    hx, hy, hz = way[1] * fz - way[2] * fy, way[2] * fx - way[0] * fz, way[0] * fy - way[1] * fx
    determinant = ex * hx + ey * hy + ez * hz
    if determinant < _PARALLEL:
        return -1.0
    tx, ty, tz = start[0] - p[0], start[1] - p[1], start[2] - p[2]
    first = tx * hx + ty * hy + tz * hz
    if first < 0.0 or first > determinant:
        return -1.0
    qx, qy, qz = ty * ez - tz * ey, tz * ex - tx * ez, tx * ey - ty * ex
    second = way[0] * qx + way[1] * qy + way[2] * qz
    if second < 0.0 or first + second > determinant:
        return -1.0
    return (fx * qx + fy * qy + fz * qz) / determinant


@compile_when_called
def passes(sphere: Any, start: Any, way: Any, longest: Any) -> Any:
    """Whether a ray meets a sphere (middle and squared radius) before it ends."""
    x, y, z = sphere[0] - start[0], sphere[1] - start[1], sphere[2] - start[2]
    ahead = x * way[0] + y * way[1] + z * way[2]
    beyond = max(-ahead, ahead - longest, 0.0)
    return x * x + y * y + z * z - ahead * ahead + beyond * beyond <= sphere[3]


@compile_when_called
def nearest_hit(vertices: Any, faces: Any, spheres: Any, block: Any, start: Any, way: Any, best: Any) -> Any:
    """Distance of a ray's first hit with a block's triangles, if it is below ``best``; otherwise ``best``."""
    for m in range(block * _BLOCK, min((block + 1) * _BLOCK, faces.shape[0])):
        if passes(spheres[m], start, way, best):
            a, b, c = faces[m]
            along = crossing(vertices[a], vertices[b], vertices[c], start, way)
            if 0.0 < along < best:
                best = along
    return best


@compile_when_called
def hits_on_meshes(vertices: Any, faces: Any, starts: Any, ways: Any, longest: Any) -> Any:
    """Of rays with the mesh of their own sample; faces seen from behind are passed through.

    Args:
        vertices: shape (s, n, 3); faces: shape (m, 3).
        starts, ways, longest: as for outlines, in space.

    Returns:
        Distances, shape (s, r).
    """
    found = np.full((starts.shape[0], starts.shape[1]), np.inf)
    for s in range(starts.shape[0]):
        spheres = bounding_spheres(vertices[s], faces)
        blocks = spheres_of_blocks(spheres)
        for r in range(starts.shape[1]):
            best = longest[r]
            for block in range(blocks.shape[0] if best > 0.0 else 0):
                if passes(blocks[block], starts[s, r], ways[s, r], best):
                    best = nearest_hit(vertices[s], faces, spheres, block, starts[s, r], ways[s, r], best)
            if best < longest[r]:
                found[s, r] = best
    return found


def first_hits(corners: Array, cells: NDArray[np.int64], starts: Array, ways: Array, longest_m: Array) -> Array:
    """Distance of the first hit of each ray with its own sample of the surface, shape (s, r); infinite for none.

    Args:
        corners: sampled vertices, shape (s, n, d).
        cells: edges in order around the outline (d = 2), or triangles (d = 3).
        starts, ways: rays of each sample with unit directions, shape (s, r, d).
        longest_m: where the rays end, shape (r,).
    """
    arrays = [np.ascontiguousarray(rows, dtype=float) for rows in (corners, starts, ways, longest_m)]
    if corners.shape[2] == 2:
        return np.asarray(hits_on_outlines(*arrays))
    faces = np.ascontiguousarray(cells, dtype=np.int64)
    return np.asarray(hits_on_meshes(arrays[0], faces, *arrays[1:]))
