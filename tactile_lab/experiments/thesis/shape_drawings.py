"""One shape from contacts at known places, with its outline for a drawing: the figures of chapter 2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.evaluation.shape import horizontal_outline
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.sensing import NORMAL_SIGMA_rad, POINT_SIGMA_m, SimulatedGrasps
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.metrics.metrics import contour_errors, mesh_errors
from tactile_lab.slam.shape.selection.models import fit_shape
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon, sample_polygon
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

_KERNEL_STEPS = 30
_DRAWN_STEP_m = 0.001
_MESH_STEP_m = 0.004
_BESIDE_m = 0.010
_MANY = 160
_ONE_SIDE = 12
_FACING = 0.1
"""Contacts whose normals point less than this along x are on the touched side."""
_CORNER = (np.array([[0.020, 0.030], [0.040, 0.030], [0.050, 0.010]]), np.array([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0]]))
"""Three contacts beside the rectangle's corner at (50, 30) mm."""
_CORNER_m = np.array([0.050, 0.030])

FIELDS: Mapping[str, GpisSettings] = {
    "SE kernel": GpisSettings(observations="offsurface", kernel="squared_exponential", prior_mean="zero"),
    "TP kernel": GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero"),
    "prior outside": GpisSettings(prior_mean="outward"),
    "prior zero": GpisSettings(prior_mean="zero"),
    "prior sphere": GpisSettings(prior_mean="sphere"),
    "prior ellipsoid": GpisSettings(prior_mean="ellipsoid"),
}
"""Fields by their names in tables: the thesis's two kernels with its points inside and outside, and priors."""
EDGE_FEATURES = "edge features"


def random_places(cell: Cell) -> dict[str, Any]:
    """Contacts all around (figures 2.5, 2.6). Cell: shape, model, contacts."""
    data = planar_data.random_contacts(cell["shape"], _MANY, cell.seed)
    return _drawn_outline(_contacts(data, 2).select(np.arange(cell["contacts"])), cell["model"], data.outline_m)


def one_grasp(cell: Cell) -> dict[str, Any]:
    """The contacts of a single grasp (figure 2.14). Cell: shape, model."""
    data = planar_data.simulate(cell["shape"], cell.seed, count=1)
    truth_m = data.outline_m @ data.world_T_body[0].matrix()[:2, :2].T + data.world_T_body[0].translation()[:2]
    return _drawn_outline(_contacts(data, 2), cell["model"], truth_m)


def one_side(cell: Cell) -> dict[str, Any]:
    """Contacts on one side only (figure 2.8, in the plane). Cell: shape, model."""
    data = planar_data.random_contacts(cell["shape"], _MANY, cell.seed)
    contacts = _contacts(data, 2)
    touched = np.flatnonzero(contacts.normals[:, 0] < _FACING)[:_ONE_SIDE]
    return _drawn_outline(contacts.select(touched), cell["model"], data.outline_m)


def corner(cell: Cell) -> dict[str, Any]:
    """Three contacts beside a corner (figure 2.9): how far the outline stays from it. Cell: shape, model."""
    rng, (places, normals) = np.random.default_rng([cell.seed, 29]), _CORNER
    noisy = normals + np.tan(NORMAL_SIGMA_rad) * rng.normal(size=normals.shape)
    contacts = ContactSet(
        places + rng.normal(0.0, POINT_SIGMA_m, places.shape),
        noisy / np.linalg.norm(noisy, axis=1, keepdims=True),
        np.full(len(places), POINT_SIGMA_m),
        np.full(len(places), NORMAL_SIGMA_rad),
    )
    figures = _drawn_outline(contacts, cell["model"], planar_data.outline(cell["shape"]))
    estimate = np.array(figures["drawing"]["estimate"]).reshape(-1, 2) / 1e3
    missed_m = np.linalg.norm(estimate - _CORNER_m, axis=1).min() if len(estimate) else np.inf
    return {**figures, "corner_mm": 1e3 * float(missed_m) if np.isfinite(missed_m) else None}


def random_places_in_space(cell: Cell) -> dict[str, Any]:
    """Contacts all around a solid (figures 2.10, 2.11). Cell: shape, model, contacts."""
    data = spatial_data.random_contacts(cell["shape"], _MANY, cell.seed, foot=True)
    contacts = _contacts(data, 3).select(np.arange(cell["contacts"]))
    return _drawn_section(contacts, cell["model"], data)


def one_grasp_in_space(cell: Cell) -> dict[str, Any]:
    """The contacts of a single grasp of a solid (figure 2.15). Cell: shape, model."""
    data = spatial_data.simulate(cell["shape"], cell.seed, count=1)
    return _drawn_section(_contacts(data, 3), cell["model"], data)


def _contacts(data: SimulatedGrasps, dimension: int) -> ContactSet:
    return ContactSet.concatenate([ContactSet.of_grasp(grasp, dimension, 0.0) for grasp in data.grasps])


def _field(contacts: ContactSet, model: str) -> Gpis:
    settings = FIELDS.get(model, FIELDS["SE kernel"])
    columns = (contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad)
    return Gpis.fit(*columns, settings).optimise(max_iterations=_KERNEL_STEPS)


def _drawn_outline(contacts: ContactSet, model: str, truth_m: Array) -> dict[str, Any]:
    """Errors without any alignment, since the places are known, and what to draw; no errors without an outline."""
    drawing = {"truth": millimetres(truth_m), "contacts": millimetres(contacts.points_m), "estimate": []}
    try:
        shape = fit_shape(
            EDGE_FEATURES.replace(" ", "-") if model == EDGE_FEATURES else "gpis", _field(contacts, model)
        )
        outline_m = shape.contour().points_m
    except ShapeError:
        return {"hausdorff_mm": None, "mean_mm": None, "beside_mm": None, "drawing": drawing}
    errors = contour_errors(outline_m, truth_m)
    drawing["estimate"] = millimetres(sample_polygon(outline_m, _DRAWN_STEP_m))
    return {
        "hausdorff_mm": 1e3 * errors.hausdorff_m,
        "mean_mm": 1e3 * errors.mean_distance_m,
        "beside_mm": 1e3 * _largest_beside(contacts.points_m, outline_m, truth_m),
        "drawing": drawing,
    }


def _largest_beside(points_m: Array, outline_m: Array, truth_m: Array) -> float:
    """Largest distance of the true outline beside a contact from the estimated one."""
    true_m = sample_polygon(truth_m, _DRAWN_STEP_m)
    beside = np.linalg.norm(true_m[:, None] - points_m[None], axis=2).min(axis=1) < _BESIDE_m
    return float(distances_to_polygon(true_m[beside], outline_m).max()) if beside.any() else 0.0


def _drawn_section(contacts: ContactSet, model: str, data: spatial_data.SpatialGrasps) -> dict[str, Any]:
    """As :func:`_drawn_outline` for a solid; drawn is the horizontal section through the contacts' mean height."""
    truth = data.mesh.copy()
    truth.apply_transform(data.world_T_body[0].matrix())
    height_m = float(contacts.points_m[:, 2].mean())
    drawing = {
        "truth": millimetres(sample_polygon(horizontal_outline(truth, height_m), _DRAWN_STEP_m)),
        "contacts": millimetres(contacts.points_m[:, :2]),
        "estimate": [],
    }
    try:
        mesh = fit_shape("gpis", _field(contacts, model)).mesh(_MESH_STEP_m)
        section_m = horizontal_outline(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False), height_m)
    except ShapeError:
        return {"hausdorff_mm": None, "mean_mm": None, "drawing": drawing}
    errors = mesh_errors(mesh, truth)
    drawing["estimate"] = millimetres(sample_polygon(section_m, _DRAWN_STEP_m))
    return {"hausdorff_mm": 1e3 * errors.hausdorff_m, "mean_mm": 1e3 * errors.mean_distance_m, "drawing": drawing}


def millimetres(points_m: Array) -> list[list[float]]:
    """Points of shape (n, 2) as plain data for a drawing."""
    return [[round(1e3 * float(x), 1), round(1e3 * float(y), 1)] for x, y in points_m]
