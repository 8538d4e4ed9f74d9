"""How the shape grows while an object is tracked, with its outline for a drawing: figures 3.11 and 3.13."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.poses import spatial, transform_points
from tactile_lab.evaluation.shape import horizontal_outline
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.sensing import SLIP_SIGMA_m, SLIP_SIGMA_rad
from tactile_lab.experiments.thesis.shape_drawings import millimetres
from tactile_lab.slam.shape.metrics.alignment import align_contours, align_meshes
from tactile_lab.slam.shape.metrics.metrics import contour_errors, mesh_errors
from tactile_lab.slam.shape.surfaces.sampling import sample_polygon
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

_DRAWN_STEP_m = 0.001


def outline_after(cell: Cell) -> dict[str, Any]:
    """The outline after the first grasps of a session (figure 3.11). Cell: shape, method, noise (percent), after."""
    data = planar_data.simulate(cell["shape"], cell.seed, motion_scale=cell["noise"] / 100, count=cell["after"])
    slam = _followed(cell, data, 2)
    contour = slam.finish().contour
    drawing = {"truth": millimetres(data.outline_m), "contacts": [], "estimate": []}
    if contour is None:
        return {"hausdorff_mm": None, "mean_mm": None, "drawing": drawing}
    fit = align_contours(contour.points_m, data.outline_m)
    errors = contour_errors(contour.points_m, data.outline_m, fit)
    flat = np.pad(sample_polygon(contour.points_m, _DRAWN_STEP_m), ((0, 0), (0, 1)))
    drawing["estimate"] = millimetres(transform_points(spatial(fit), flat)[:, :2])
    drawing["contacts"] = millimetres(transform_points(spatial(fit), _flat(slam))[:, :2])
    return {"hausdorff_mm": 1e3 * errors.hausdorff_m, "mean_mm": 1e3 * errors.mean_distance_m, "drawing": drawing}


def surface_after(cell: Cell) -> dict[str, Any]:
    """As :func:`outline_after` for a solid on the table (figure 3.13); drawn is the section at half its height."""
    data = spatial_data.simulate(cell["shape"], cell.seed, motion_scale=cell["noise"] / 100, count=cell["after"])
    mesh = _followed(cell, data, 3).finish().mesh
    height_m = float(data.mesh.bounds[:, 2].mean())
    truth_m = sample_polygon(horizontal_outline(data.mesh, height_m), _DRAWN_STEP_m)
    drawing = {"truth": millimetres(truth_m), "contacts": [], "estimate": []}
    if mesh is None:
        return {"hausdorff_mm": None, "mean_mm": None, "drawing": drawing}
    fit = align_meshes(mesh, data.mesh, upright=True)
    errors = mesh_errors(mesh, data.mesh, fit)
    placed = trimesh.Trimesh(transform_points(fit, mesh.vertices), mesh.faces, process=False)
    try:
        section_m = horizontal_outline(placed, height_m)
        drawing["estimate"] = millimetres(sample_polygon(section_m, _DRAWN_STEP_m))
    except ShapeError:  # the surface has no section there: nothing to draw, but it has its errors
        drawing["estimate"] = []
    return {"hausdorff_mm": 1e3 * errors.hausdorff_m, "mean_mm": 1e3 * errors.mean_distance_m, "drawing": drawing}


def _followed(cell: Cell, data: planar_data.PlanarGrasps | spatial_data.SpatialGrasps, dimension: int) -> TactileSlam:
    """The method after all grasps; it knows the noise of the motion."""
    scale = max(cell["noise"] / 100, 0.05)
    motion = {"translation_m": scale * SLIP_SIGMA_m, "rotation_rad": scale * SLIP_SIGMA_rad}
    given = {"method": cell["method"], "dimension": dimension, "motion": motion}
    slam = TactileSlam(SlamSettings.model_validate(given), cell.seed)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    return slam


def _flat(slam: TactileSlam) -> Array:
    """The contacts that make up the outline, object frame, shape (n, 3)."""
    return np.zeros((0, 3)) if slam.surface is None else np.pad(slam.surface.contacts_m, ((0, 0), (0, 1)))
