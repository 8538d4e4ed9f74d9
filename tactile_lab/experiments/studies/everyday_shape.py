"""One run of the choice of a shape on grasps of an everyday thing with known poses, from a cell to its figures."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.poses import rotate, transform_points
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import spatial_data
from tactile_lab.experiments.data.spatial_data import SpatialGrasps
from tactile_lab.experiments.run_metrics import mesh_figures
from tactile_lab.experiments.touched_metrics import NOTHING_TOUCHED, touched_figures
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.free_space import places_on_line

NOTHING = "nothing"
_KERNEL_STEPS = 30


@dataclass(frozen=True)
class _Estimate:
    mesh: SurfaceMesh | None
    surface: Gpis


def shape_at_known_poses(cell: Cell) -> dict[str, Any]:
    """The most probable shape of grasps all over a thing on the table, at its true poses. Cell: shape, without (a part
    of the choice of the shape, or "nothing"), grasps.
    """
    data = spatial_data.simulate(cell["shape"], cell.seed, count=cell["grasps"], heights="all")
    without = [] if cell["without"] == NOTHING else [cell["without"]]
    settings = GpisSettings.model_validate({"without": without})
    contacts = _contacts_on_body(data)
    sigmas = contacts.point_sigma_m, contacts.normal_sigma_rad
    field = Gpis.fit(contacts.points_m, contacts.normals, *sigmas, settings).optimise(max_iterations=_KERNEL_STEPS)
    floor_m = float(data.mesh.bounds[0, 2])
    started = time.process_time()
    shape = best_shape(field, _free_on_body(data), floor_m)
    try:
        mesh = shape.mesh(floor_m=floor_m)
    except ShapeError:  # the contacts enclose nothing
        return {**NOTHING_TOUCHED, **mesh_figures(None, data.mesh), "model": shape.name}
    choosing_s = time.process_time() - started
    figures = {**mesh_figures(mesh, data.mesh), **touched_figures(data, _Estimate(mesh, field))}
    return {**figures, "model": shape.name, "finish_ms": round(1e3 * choosing_s, 1)}


def _contacts_on_body(data: SpatialGrasps) -> ContactSet:
    """All contacts in body coordinates."""
    placed = []
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        seen = ContactSet.of_grasp(grasp, 3, 0.0)
        points_m = transform_points(pose.inverse(), seen.points_m)
        normals = rotate(pose.inverse(), seen.normals)
        placed.append(ContactSet(points_m, normals, seen.point_sigma_m, seen.normal_sigma_rad, np.empty((0, 3))))
    return ContactSet.concatenate([each for each in placed if len(each)])


def _free_on_body(data: SpatialGrasps) -> Array:
    """Places that fingers went through, body coordinates, shape (q, 3)."""
    pairs = zip(data.grasps, data.world_T_body, strict=True)
    paths = [(pose.inverse(), path) for grasp, pose in pairs for path in grasp.approach_paths]
    return np.vstack([transform_points(body_T_world, places_on_line(path)) for body_T_world, path in paths])
