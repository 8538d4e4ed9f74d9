"""One run of a shape model on contacts with known poses, from a cell to its figures."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.experiments.run_metrics import contour_figures, mesh_figures
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.gpis_shape import GpisShape
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.model import FittedShape
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

SHAPE_MODELS: dict[str, GpisSettings] = {
    "SE, inside and outside points": GpisSettings(
        observations="offsurface", kernel="squared_exponential", prior_mean="zero"
    ),
    "TP, inside and outside points": GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero"),
    "SE, normals": GpisSettings(kernel="squared_exponential"),
    "TP, normals": GpisSettings(kernel="thin_plate"),
    "Matérn, normals": GpisSettings(),
    "chosen by evidence": GpisSettings(),
}
"""Shape models by the names of tables and plots; the first two are the thesis's."""

_KERNEL_STEPS = 30
MOST_CONTACTS = 160


def contour_of_random_contacts(cell: Cell) -> dict[str, Any]:
    """A shape model on random contacts with known poses. Cell: shape, model, contacts."""
    data = planar_data.random_contacts(cell["shape"], MOST_CONTACTS, cell.seed)
    shape, seconds = _fit(_first_contacts(data, cell["contacts"], 2), cell["model"])
    return {**contour_figures(shape.contour(), data.outline_m), "model": shape.name, "fit_ms": 1e3 * seconds}


def mesh_of_random_contacts(cell: Cell) -> dict[str, Any]:
    """As :func:`contour_of_random_contacts`, for a solid that is touched from all sides."""
    data = spatial_data.random_contacts(cell["shape"], MOST_CONTACTS, cell.seed, foot=True)
    shape, seconds = _fit(_first_contacts(data, cell["contacts"], 3), cell["model"])
    return {**mesh_figures(shape.mesh(), data.mesh), "model": shape.name, "fit_ms": 1e3 * seconds}


def _first_contacts(data: SimulatedGrasps, count: int, dimension: int) -> ContactSet:
    """The first contacts in the world frame, which for random contacts differs from the object's frame only in
    height.
    """
    sets = [ContactSet.of_grasp(grasp, dimension, 0.0) for grasp in data.grasps]
    return ContactSet.concatenate(sets).select(np.arange(count))


def _fit(contacts: ContactSet, model: str) -> tuple[FittedShape, float]:
    """Fit a shape model with its kernel optimized; also returns the computing time, seconds."""
    started = time.perf_counter()
    gpis = Gpis.fit(
        contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad, SHAPE_MODELS[model]
    ).optimise(max_iterations=_KERNEL_STEPS)
    shape = best_shape(gpis) if model == "chosen by evidence" else GpisShape(gpis)
    return shape, time.perf_counter() - started
