"""Figures over the part of a surface that the hand's geometry lets a fingertip get to, touched or not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from drivers.shadow.closing.posture import HandShape
from tactile_lab.experiments.reach.reachable import ANY_YAW_rad, Mask, are_in_reach
from tactile_lab.slam.shape.metrics.alignment import align_meshes
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, sample_mesh_with_normals
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

KNOWN_m = 0.005
"""A place of the surface is known where the model is no farther from it, and says that it is not."""

NOTHING_KNOWN: dict[str, Any] = {"known_share": 0.0, "reach_hausdorff_mm": None}

_PLACES, _PLACES_OF_MODEL = 1_000, 5_000
"""Places that are looked at: the share is right to 0.02."""


def reach_figures(
    estimate: SurfaceMesh | None, truth: trimesh.Trimesh, yaws_rad: Sequence[tuple[float, float]] = (ANY_YAW_rad,)
) -> dict[str, Any]:
    """What is known of the surface in a fingertip's reach, at the best fit, and how far off the model is there.

    ``known_share`` is the share where the model is within :data:`KNOWN_m`, and says so with two standard deviations;
    ``reach_hausdorff_mm`` the largest distance in both directions, of the model's places those nearest to places in
    reach.

    Args:
        estimate: the model; without one nothing is known.
        truth: the object as it stands on the table, its lowest point on it.
        yaws_rad: of the hand, from lowest to highest, seen from the object.
    """
    if estimate is None:
        return dict(NOTHING_KNOWN)
    points_m, normals = sample_mesh_with_normals(truth, _PLACES)
    reached = are_in_reach(truth, points_m, normals, yaws_rad, HandShape())
    if not reached.any():
        return dict(NOTHING_KNOWN)
    seen = trimesh.Trimesh(estimate.vertices, estimate.faces, process=False)
    fit = align_meshes(seen, truth, upright=True)
    moved = trimesh.Trimesh(transform_points(fit, estimate.vertices), estimate.faces, process=False)
    there_m, back_m = distances_to_mesh(points_m[reached], moved), _back_m(moved, truth, points_m, reached)
    near = cKDTree(np.asarray(moved.vertices)).query(points_m[reached])[1]
    is_known = (there_m <= KNOWN_m) & (2 * estimate.sigma_m[near] <= KNOWN_m)
    farthest_m = max(there_m.max(), back_m.max(initial=0.0))
    return {"known_share": float(np.mean(is_known)), "reach_hausdorff_mm": 1e3 * float(farthest_m)}


def _back_m(model: trimesh.Trimesh, truth: trimesh.Trimesh, points_m: Array, reached: Mask) -> Array:
    """Distances from the model to the truth, of the model's places whose nearest one of some true ones is in reach."""
    places_m = sample_mesh_with_normals(model, _PLACES_OF_MODEL)[0]
    return distances_to_mesh(places_m[reached[cKDTree(points_m).query(places_m)[1]]], truth)
