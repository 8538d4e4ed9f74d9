"""How well grasps can determine a solid with flat faces on a table at best, with known and with estimated poses.

Uses :mod:`contact_limit`. The table, and so the underside, is also known; regular solids have vertical walls and a
horizontal top.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data import spatial_data
from tactile_lab.experiments.groups import REFERENCE_METHOD
from tactile_lab.experiments.run_metrics import mesh_figures, registration_mm
from tactile_lab.experiments.runs.limits.contact_limit import FlatSides, Limit, SeenSession, together
from tactile_lab.slam.shape.surfaces.sampling import nearest_on_mesh
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.faces.flat_faces import tangents

_DECIMALS = 6
"""Triangles whose planes agree this well form one face."""

_UPRIGHT, _LEVEL = 0.99, 0.01
_NORMAL_WEIGHT_m = 1e-3
"""Weight of the normal in assigning contacts to faces: on an edge the normal decides, elsewhere the distance."""


def limit_of_solid(cell: Cell) -> dict[str, Any]:
    """The figures of a solid with a drawn error. Cell: shape, noise (percent), sides, method, grasps."""
    scale = cell["noise"] / 100
    data = spatial_data.simulate(cell["shape"], cell.seed, motion_scale=scale, count=cell["grasps"])
    session = SeenSession.of(data, scale)
    corners_m = session.in_frame(data.world_T_body[0], np.asarray(data.mesh.vertices))
    mesh = trimesh.Trimesh(corners_m, data.mesh.faces, process=False)
    faces, meeting = _faces(mesh)
    sides = _sides(mesh, faces, regular=cell["sides"] == "regular")
    limit = Limit(session, sides, _touched_faces(session, mesh, sides))
    rng = np.random.default_rng([cell.seed, 20263])
    error = limit.drawn_error(rng, known_poses=cell["method"] == REFERENCE_METHOD)
    estimate = _surface(sides.corners(corners_m, meeting, error), mesh)
    return {
        **mesh_figures(estimate, mesh),
        "registration_mm": registration_mm(data, session.estimate(error), 3),
    }


def _faces(mesh: trimesh.Trimesh) -> tuple[Array, NDArray[np.bool_]]:
    """Planes (normal, distance) of a solid, shape (n, 4), and which of them meet at each corner, shape (k, n)."""
    distances = np.sum(mesh.face_normals * mesh.triangles[:, 0], axis=1)
    planes = np.column_stack([mesh.face_normals, distances])
    _, first, label = np.unique(planes.round(_DECIMALS), axis=0, return_index=True, return_inverse=True)
    meeting = np.zeros((len(mesh.vertices), len(first)), dtype=bool)
    meeting[mesh.faces, label.ravel()[:, None]] = True
    return planes[first], meeting


def _sides(mesh: trimesh.Trimesh, faces: Array, *, regular: bool) -> FlatSides:
    """All faces may rotate and move but the underside, which is on the table."""
    normals, distances = faces[:, :3], faces[:, 3]
    foot = normals[:, 2] < -_UPRIGHT
    turning = _turning_upright(normals) if regular else _turning_freely(normals, ~foot)
    return FlatSides(normals, distances, turning, np.eye(len(faces))[:, ~foot])


def _turning_freely(normals: Array, loose: NDArray[np.bool_]) -> Array:
    """Each free face may rotate about both of its tangents."""
    each = np.eye(len(normals))[:, loose]
    both = tangents(normals)
    return np.concatenate([both[:, :, axis, None] * each[:, None, :] for axis in (0, 1)], axis=2)


def _turning_upright(normals: Array) -> Array:
    """Walls may rotate about the vertical; parallel and perpendicular ones rotate together."""
    walls = np.abs(normals[:, 2]) < _LEVEL
    shared = together(np.arctan2(normals[walls, 1], normals[walls, 0]))
    groups = np.zeros((len(normals), shared.shape[1]))
    groups[walls] = shared
    along = np.column_stack([-normals[:, 1], normals[:, 0], np.zeros(len(normals))])
    return np.asarray(along[:, :, None] * groups[:, None, :])


def _touched_faces(session: SeenSession, mesh: trimesh.Trimesh, sides: FlatSides) -> NDArray[np.int64]:
    """The face of each contact, shape (n,)."""
    _, places = nearest_on_mesh(session.contacts_m, mesh)
    away_m = np.abs(places @ sides.normals.T - sides.distances_m)
    return np.asarray((away_m - _NORMAL_WEIGHT_m * session.normals @ sides.normals.T).argmin(axis=1), dtype=np.int64)


def _surface(corners_m: Array, mesh: trimesh.Trimesh) -> SurfaceMesh:
    """The solid with its corners displaced."""
    moved = trimesh.Trimesh(corners_m, mesh.faces, process=False)
    normals = np.asarray(moved.vertex_normals)
    return SurfaceMesh(corners_m, np.asarray(mesh.faces), np.zeros(len(corners_m)), normals, is_closed=True)
