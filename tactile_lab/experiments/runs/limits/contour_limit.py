"""How well grasps can determine a polygon at best, with known and with estimated poses (:mod:`contact_limit`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import planar_data
from tactile_lab.experiments.data.outlines import edge_normals
from tactile_lab.experiments.groups import REFERENCE_METHOD
from tactile_lab.experiments.run_metrics import contour_figures, registration_mm
from tactile_lab.experiments.runs.limits.contact_limit import FlatSides, Limit, SeenSession, together
from tactile_lab.slam.shape.surfaces.sampling import distances_to_sides
from tactile_lab.slam.shape.surfaces.surface import Contour

POLYGONS = ("rectangle", "triangle", "L", "hexagon", "trapezoid", "pentagon")


def limit_of_contour(cell: Cell) -> dict[str, Any]:
    """The figures of a polygon with a drawn error. Cell: shape, noise (percent), sides, method, grasps."""
    scale = cell["noise"] / 100
    data = planar_data.simulate(cell["shape"], cell.seed, motion_scale=scale, count=cell["grasps"])
    session = SeenSession.of(data, scale)
    outline_m = session.in_frame(data.world_T_body[0], np.pad(data.outline_m, ((0, 0), (0, 1))))[:, :2]
    touched = distances_to_sides(session.contacts_m[:, :2], outline_m).argmin(axis=1).astype(np.int64)
    sides = _sides(outline_m, regular=cell["sides"] == "regular")
    rng = np.random.default_rng([cell.seed, 20261])
    error = Limit(session, sides, touched).drawn_error(rng, known_poses=cell["method"] == REFERENCE_METHOD)
    each = np.eye(len(outline_m), dtype=bool)
    corners = sides.corners(outline_m, each | np.roll(each, -1, axis=1), error)
    figures = contour_figures(Contour(corners, np.zeros(len(corners)), is_closed=True), outline_m)
    return {**figures, "registration_mm": registration_mm(data, session.estimate(error), 2)}


def _sides(outline_m: Array, *, regular: bool) -> FlatSides:
    """Sides from each corner to the next; regular ones rotate together."""
    normals = edge_normals(outline_m)
    groups = together(np.arctan2(normals[:, 1], normals[:, 0])) if regular else np.eye(len(normals))
    along = np.column_stack([-normals[:, 1], normals[:, 0]])
    turning = along[:, :, None] * groups[:, None, :]
    return FlatSides(normals, np.sum(normals * outline_m, axis=1), turning, np.eye(len(normals)))
