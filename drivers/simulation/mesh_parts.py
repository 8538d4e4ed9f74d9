"""Meshes of several parts, as modelling programs export them: which lie inside others, and what all enclose together.

The winding number decides what is inside, even where parts intersect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from drivers.core.contacts import Array

_INSIDE = 0.5  # winding number
_FINEST_m, _CELLS_ON_SURFACE = 0.001, 15_000
_OFF_NODE_m = 1e-6
"""A surface through a grid node would give triangles without area."""


def without_inner_parts(parts: Sequence[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """The parts that do not lie wholly inside a larger one, such as the inner wall of a closed shell."""
    found: list[trimesh.Trimesh] = []
    for part in sorted(parts, key=lambda part: -abs(part.volume)):
        if not any(_contains(other, part.vertices) for other in found):
            found.append(part)
    return found


def _contains(mesh: trimesh.Trimesh, places_m: Array) -> bool:
    low, high = mesh.bounds
    if np.any(places_m < low) or np.any(places_m > high):
        return False
    return bool(_is_inside(mesh, places_m).all())


def outer_surface(parts: Sequence[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """The bodies that parts enclose, merged where they meet; edges lose a fraction of a millimetre."""
    import igl  # here, so that importing this module stays quick

    mesh: trimesh.Trimesh = trimesh.util.concatenate(list(parts))  # type: ignore[assignment]
    step_m = max(_FINEST_m, float(np.sqrt(mesh.area / _CELLS_ON_SURFACE)))
    axes = [np.arange(low - 1.5 * step_m, high + 2 * step_m, step_m) for low, high in mesh.bounds.T]
    nodes_m = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    outside_m = _distances_m(mesh, nodes_m.reshape(-1, 3)).reshape(nodes_m.shape[:3])
    ordered = outside_m.T.ravel(), nodes_m.transpose(2, 1, 0, 3).reshape(-1, 3)  # the first axis runs fastest
    vertices, faces, _ = igl.marching_cubes(*ordered, *outside_m.shape, 0.0)
    merged = trimesh.Trimesh(vertices, faces)
    if merged.volume < 0:
        merged.invert()
    return [body for body in merged.split(only_watertight=True) if body.volume > 0]


def nearest_gap_m(mesh: trimesh.Trimesh, others: Sequence[trimesh.Trimesh]) -> float:
    """The distance from a body to the nearest of others."""
    return min(float(np.abs(_distances_m(mesh, other.vertices)).min()) for other in others)


def _distances_m(mesh: trimesh.Trimesh, places_m: Array) -> Array:
    """Of places (n, 3) to the surface, negative inside, never zero."""
    import igl  # here, so that importing this module stays quick

    squared, _, _ = igl.point_mesh_squared_distance(np.ascontiguousarray(places_m), *_arrays(mesh))
    away_m = np.maximum(np.sqrt(np.asarray(squared)), _OFF_NODE_m)
    return np.asarray(np.where(_is_inside(mesh, places_m), -away_m, away_m))


def _is_inside(mesh: trimesh.Trimesh, places_m: Array) -> Array:
    import igl  # here, so that importing this module stays quick

    return np.asarray(np.abs(igl.fast_winding_number(*_arrays(mesh), np.ascontiguousarray(places_m))) > _INSIDE)


def _arrays(mesh: trimesh.Trimesh) -> tuple[Array, Array]:
    return np.ascontiguousarray(mesh.vertices, float), np.ascontiguousarray(mesh.faces, np.int64)
