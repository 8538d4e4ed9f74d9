"""First intersections of rays with a triangle mesh; compiled, for many calls with few rays and thousands of
triangles.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.compiled import compile_when_called

_PARALLEL = 1e-14


def first_hits(corners_m: Array, starts_m: Array, ways: Array, longest_m: float) -> tuple[Array, Any]:
    """Distance along each ray to the first triangle that it meets, and the triangle's index; -1 if it meets none.

    Args:
        corners_m: triangles, shape (m, 3, 3).
        starts_m, ways: starts and unit directions of the rays, each of shape (n, 3).
        longest_m: length of the rays.
    """
    starts, directions = (np.ascontiguousarray(rows, dtype=float) for rows in (starts_m, ways))
    distances, faces = _cast(corners_m, starts, directions, longest_m)
    return np.asarray(distances), faces


@compile_when_called
def _cast(corners: Any, starts: Any, ways: Any, longest: float) -> Any:
    distances = np.full(len(starts), np.inf)
    faces = np.full(len(starts), -1)
    for ray in range(len(starts)):
        best = longest
        for face in range(len(corners)):
            distance = _crossing(corners[face], starts[ray], ways[ray])
            if 0.0 < distance < best:
                best = distance
                distances[ray], faces[ray] = distance, face
    return distances, faces


@compile_when_called
def _crossing(corners: Any, start: Any, way: Any) -> Any:
    """Distance to one triangle (Moeller and Trumbore 1997); -1 if the ray misses it."""
    ax, ay, az = corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1], corners[1, 2] - corners[0, 2]
    bx, by, bz = corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1], corners[2, 2] - corners[0, 2]
    px, py, pz = way[1] * bz - way[2] * by, way[2] * bx - way[0] * bz, way[0] * by - way[1] * bx
    determinant = ax * px + ay * py + az * pz
    if abs(determinant) < _PARALLEL:
        return -1.0
    sx, sy, sz = start[0] - corners[0, 0], start[1] - corners[0, 1], start[2] - corners[0, 2]
    first = (sx * px + sy * py + sz * pz) / determinant
    if first < 0.0 or first > 1.0:
        return -1.0
    qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
    second = (way[0] * qx + way[1] * qy + way[2] * qz) / determinant
    if second < 0.0 or first + second > 1.0:
        return -1.0
    return (bx * qx + by * qy + bz * qz) / determinant
