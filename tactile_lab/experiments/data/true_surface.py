"""The true surface of an object, and the part of it that lies near an estimate."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from tactile_lab.evaluation.shape import horizontal_outline
from tactile_lab.experiments.data.explored_objects import moved_alike
from tactile_lab.slam.exploration.policy import Surface
from tactile_lab.slam.shape.surfaces.sampling import nearest_on_mesh, sample_polygon

_UNDERSIDE = -0.9
_SAMPLES = 2000
_LEAST_AREA_m2 = 1e-12


def true_outline(mesh: trimesh.Trimesh) -> Array:
    """The outline at half the height, shape (n, 2)."""
    return horizontal_outline(mesh, float(mesh.bounds[:, 2].mean()))


def reachable_points(mesh: trimesh.Trimesh, dimension: int) -> Array:
    """Points of the true surface that fingers can touch: the outline at half the height, or all but the underside.

    Returns:
        Shape (n, dimension), object frame.
    """
    if dimension == 2:
        return sample_polygon(true_outline(mesh), 0.001)
    points, faces = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=0)
    return np.asarray(points[mesh.face_normals[faces][:, 2] > _UNDERSIDE])


def within(points_m: Array, places_m: Array, reach_m: float) -> NDArray[np.bool_]:
    """Which points lie within reach of one of the given places; none if there are no places."""
    if len(places_m) == 0:
        return np.zeros(len(points_m), dtype=bool)
    return np.asarray(cKDTree(places_m).query(points_m)[0] < reach_m)


def lay_over(points_m: Array, source_m: Array, target_m: Array) -> Array:
    """Points transformed by the motion that best maps ``source_m`` onto ``target_m``, both (n, 3): in the plane, and
    along z.
    """
    flat = moved_alike(points_m[:, :2], source_m[:, :2], target_m[:, :2])
    if points_m.shape[1] == 2:
        return flat
    return np.column_stack([flat, points_m[:, 2] + float(np.mean(target_m[:, 2] - source_m[:, 2]))])


def surface_within(surface: Surface | None, points_m: Array, reach_m: float) -> NDArray[np.bool_]:
    """Which points, shape (n, 3), lie within reach of the estimated surface; none if there is no surface."""
    if surface is None:
        return np.zeros(len(points_m), dtype=bool)
    mesh = trimesh.Trimesh(surface.points_m, surface.cells, process=False)
    return np.asarray(nearest_on_mesh(points_m, mesh)[0] < reach_m)


def true_share(surface: Surface, origin_height_m: float, mesh: trimesh.Trimesh, reach_m: float) -> float:
    """Share of an estimated surface within reach of the true one, without the part that faces the table.

    Args:
        surface: the estimated surface.
        origin_height_m: height of the object frame's origin above the table.
        mesh: the true surface, in the same frame.
        reach_m: largest distance that counts as near.
    """
    away_m, _ = nearest_on_mesh(surface.points_m, mesh)
    sizes = surface.sizes * surface.touchable(origin_height_m)
    return float(sizes[away_m < reach_m].sum() / max(sizes.sum(), _LEAST_AREA_m2))
