"""All shape models of chapter 2 on the same contacts at known places, with the fields and the choice by evidence."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from drivers.core.errors import ShapeError
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.run_metrics import NO_SHAPE, contour_figures, mesh_figures
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.selection.models import fit_shape
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

OFF_SURFACE = {"GPIS, SE kernel": "squared_exponential", "GPIS, TP kernel": "thin_plate"}
OTHERS = {
    "GPIS, normals": "gpis",
    "superquadric": "superquadric",
    "Nagata patches": "nagata",
    "occupancy grid": "occupancy",
    "point cloud": "point-cloud",
    "edge features": "edge-features",
    "chosen by evidence": "auto",
}
MODELS = (*OFF_SURFACE, *OTHERS)
"""Section 2.1's models, the thesis's field with both kernels, and ours."""
_KERNEL_STEPS = 30
_MANY = 160


def in_plane(cell: Cell) -> dict[str, Any]:
    """An outline from random contacts. Cell: shape, model, contacts."""
    data = planar_data.random_contacts(cell["shape"], _MANY, cell.seed)
    started = time.perf_counter()
    try:
        contour = _fitted(data, cell, 2).contour()
    except ShapeError:
        return dict(NO_SHAPE)
    spent_ms = 1e3 * (time.perf_counter() - started)
    return {**contour_figures(contour, data.outline_m), "fit_ms": spent_ms}


def in_space(cell: Cell) -> dict[str, Any]:
    """A surface from random contacts on a solid. Cell: shape, model, contacts."""
    data = spatial_data.random_contacts(cell["shape"], _MANY, cell.seed, foot=True)
    started = time.perf_counter()
    try:
        mesh = _fitted(data, cell, 3).mesh()
    except ShapeError:
        return dict(NO_SHAPE)
    spent_ms = 1e3 * (time.perf_counter() - started)
    return {**mesh_figures(mesh, data.mesh), "fit_ms": spent_ms}


def _fitted(data: planar_data.PlanarGrasps | spatial_data.SpatialGrasps, cell: Cell, dimension: int) -> Any:
    sets = [ContactSet.of_grasp(grasp, dimension, 0.0) for grasp in data.grasps]
    contacts = ContactSet.concatenate(sets).select(np.arange(cell["contacts"]))
    model = cell["model"]
    off_surface = {"observations": "offsurface", "kernel": OFF_SURFACE.get(model), "prior_mean": "zero"}
    settings = GpisSettings.model_validate(off_surface) if model in OFF_SURFACE else GpisSettings()
    columns = (contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad)
    field = Gpis.fit(*columns, settings).optimise(max_iterations=_KERNEL_STEPS)
    return fit_shape(OTHERS.get(model, "gpis"), field)
