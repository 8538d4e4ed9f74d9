"""What viewers are told beside the samples: the grasp that comes next, and the estimated surface."""

from __future__ import annotations

from typing import Any

import numpy as np

from sessions.explorer import KnownShape
from sessions.grasp_cycle import GraspPlan
from tactile_lab.errors import ShapeError
from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.surface import extract_contour, extract_mesh

CONTOUR_RESOLUTION_m, MESH_RESOLUTION_m = 0.002, 0.006


def plan_message(index: int, plan: GraspPlan) -> dict[str, Any]:
    """The grasp number ``index``, from 0, as plain data; the frame is on the table, metres and radians."""
    frame = plan.frame
    return {
        "index": index,
        "closing": plan.closing,
        "x_m": frame.x_m,
        "y_m": frame.y_m,
        "yaw_rad": frame.yaw_rad,
        "height_m": plan.height_m,
        "reason": plan.reason,
    }


def surface_message(known: KnownShape | None) -> dict[str, Any]:
    """The surface in the object frame, with the standard deviation at each vertex.

    An outline (dimension 2) is closed and has no faces. Without a closed shape there are no vertices.
    """
    if known is None:
        return _message(2, np.zeros((0, 3)), np.zeros((0, 3), dtype=int), np.zeros(0), 0.0, 0.0)
    try:
        vertices_m, faces, sigma_m = _surface(known)
    except ShapeError:
        vertices_m, faces, sigma_m = np.zeros((0, 3)), np.zeros((0, 3), dtype=int), np.zeros(0)
    return _message(known.dimension, vertices_m, faces, sigma_m, known.explored, known.origin_height_m)


def _surface(known: KnownShape) -> tuple[Array, Any, Array]:
    if known.dimension == 2:
        contour = extract_contour(known.field, resolution_m=CONTOUR_RESOLUTION_m)
        flat = np.column_stack([contour.points_m, np.zeros(len(contour.points_m))])
        return flat, np.zeros((0, 3), dtype=int), contour.sigma_m
    mesh = extract_mesh(known.field, resolution_m=MESH_RESOLUTION_m)
    return mesh.vertices, mesh.faces, mesh.sigma_m


def _message(
    dimension: int, vertices_m: Array, faces: Any, sigma_m: Array, explored: float, height_m: float
) -> dict[str, Any]:
    return {
        "dimension": dimension,
        "vertices_m": np.round(vertices_m, 5).tolist(),
        "faces": np.asarray(faces).tolist(),
        "sigma_m": np.round(sigma_m, 6).tolist(),
        "explored": explored,
        "origin_height_m": height_m,
    }
