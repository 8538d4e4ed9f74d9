"""Figures over the touched part of a surface: it is evaluated only near the contacts.

A point counts if there is a contact within :data:`REACH_m` that does not face the opposite way (so the outside of a cup
does not count for its inside). What faces the table does not count, since no finger can reach it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import trimesh
from gtsam import Pose3
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import rotate, spatial, transform_points
from tactile_lab.experiments.data.planar_data import PlanarGrasps
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.metrics.alignment import align_contours, align_meshes
from tactile_lab.slam.shape.surfaces.sampling import (
    distances_to_mesh,
    distances_to_polygon,
    sample_mesh_with_normals,
    sample_polygon,
)
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

REACH_m = 0.015

NOTHING_TOUCHED: dict[str, Any] = {
    "touched_hausdorff_mm": None,
    "touched_mean_mm": None,
    "touched_within_2_sigma": None,
    "touched_share": None,
}

_FACING_AWAY = -0.5
_UNDERSIDE = -0.9
_LARGEST_EDGE_m = 0.004
_SAMPLES = 20_000
_STEP_m = 0.0005


class Touched(Protocol):
    """What was touched: the true surface, its pose at each grasp, and the grasps."""

    @property
    def mesh(self) -> trimesh.Trimesh: ...
    @property
    def world_T_body(self) -> Sequence[Pose3]: ...
    @property
    def grasps(self) -> Sequence[Grasp]: ...


class Estimated(Protocol):
    """What was estimated: the surface, and the field with its contacts; None if there is none."""

    @property
    def mesh(self) -> SurfaceMesh | None: ...
    @property
    def surface(self) -> Gpis | None: ...


@dataclass(frozen=True)
class TouchedObject:
    """What was touched in a session; see :class:`Touched`."""

    mesh: trimesh.Trimesh
    world_T_body: Sequence[Pose3]
    grasps: Sequence[Grasp]


def touched_figures(data: Touched, result: Estimated) -> dict[str, Any]:
    """Figures of a run on the table: Hausdorff and mean distance after the best fit of the touched parts, the share of
    the estimate's touched part within two sigma, and the share of the true surface that was touched.
    """
    estimate, field = result.mesh, result.surface
    if estimate is None or field is None:
        return dict(NOTHING_TOUCHED)
    truth = _divided(data.mesh)
    seen = trimesh.Trimesh(estimate.vertices, estimate.faces, process=False)
    near_truth, near_seen = _true_contacts(data), _Contacts(field.contacts_m, field.normals)
    touched_truth, touched_seen = near_truth.part_of(truth), near_seen.part_of(seen)
    if len(touched_truth.faces) == 0 or len(touched_seen.faces) == 0:
        return dict(NOTHING_TOUCHED)
    fit = align_meshes(touched_seen, touched_truth, upright=True)
    moved = trimesh.Trimesh(transform_points(fit, estimate.vertices), estimate.faces, process=False)
    there = distances_to_mesh(sample_mesh_with_normals(touched_truth, _SAMPLES)[0], moved)
    back = distances_to_mesh(transform_points(fit, sample_mesh_with_normals(touched_seen, _SAMPLES)[0]), data.mesh)
    vertices = near_seen.near(estimate.vertices, estimate.normals)
    errors = distances_to_mesh(np.asarray(moved.vertices)[vertices], data.mesh)
    return {
        "touched_hausdorff_mm": 1e3 * float(max(there.max(), back.max())),
        "touched_mean_mm": 1e3 * float(there.mean() + back.mean()) / 2,
        "touched_within_2_sigma": float(np.mean(errors <= 2 * estimate.sigma_m[vertices])),
        "touched_share": float(touched_truth.area / data.mesh.area),
    }


def touched_outline_figures(data: PlanarGrasps, result: SlamResult) -> dict[str, Any]:
    """As :func:`touched_figures` in the plane: of points within :data:`REACH_m` of a contact, after the best fit of the
    whole outlines.
    """
    estimate, field = result.contour, result.surface
    if estimate is None or field is None:
        return dict(NOTHING_TOUCHED)
    fit = spatial(align_contours(estimate.points_m, data.outline_m))
    outline_m, contacts_m = _flat(fit, estimate.points_m), _flat(fit, field.contacts_m)
    touched_m = np.vstack([_flat(pose.inverse(), grasp.points_world_m) for grasp, pose in _placed(data)])
    truth_m = sample_polygon(data.outline_m, _STEP_m)
    is_near = cKDTree(touched_m).query(truth_m)[0] <= REACH_m
    told = cKDTree(contacts_m).query(outline_m)[0] <= REACH_m
    errors_m, sigma_m = distances_to_polygon(outline_m[told], data.outline_m), estimate.sigma_m[told]
    there_m = distances_to_polygon(truth_m[is_near], outline_m)
    return {
        "touched_hausdorff_mm": 1e3 * float(max(there_m.max(), errors_m.max())),
        "touched_mean_mm": 1e3 * float(there_m.mean() + errors_m.mean()) / 2,
        "touched_within_2_sigma": float(np.mean(errors_m <= 2 * sigma_m)),
        "touched_share": float(np.mean(is_near)),
    }


class _Contacts:
    """Contacts in a surface's frame: points and outward normals, each of shape (n, 3)."""

    def __init__(self, points_m: Array, normals: Array) -> None:
        self._points_m, self._normals = points_m, normals
        self._tree = cKDTree(points_m)

    def near(self, points_m: Array, normals: Array) -> NDArray[np.bool_]:
        """Whether points with outward normals, shapes (q, 3), count."""
        found = self._tree.query_ball_point(points_m, REACH_m)
        pairs = zip(found, normals, strict=True)
        faced = [bool(rows) and (self._normals[rows] @ way).max() > _FACING_AWAY for rows, way in pairs]
        return np.array(faced, dtype=bool) & (normals[:, 2] > _UNDERSIDE)

    def part_of(self, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
        """The triangles of a mesh that count, judged by their centres."""
        kept = self.near(mesh.triangles_center, mesh.face_normals)
        return trimesh.Trimesh(mesh.vertices, mesh.faces[kept], process=False)


def _true_contacts(data: Touched) -> _Contacts:
    """The measured contacts, placed by the true poses."""
    pairs = [(pose.inverse(), grasp) for grasp, pose in _placed(data)]
    points = [transform_points(pose, grasp.points_world_m) for pose, grasp in pairs]
    normals = [rotate(pose, np.array([contact.normal_world for contact in grasp.contacts])) for pose, grasp in pairs]
    return _Contacts(np.vstack(points), np.vstack(normals))


def _placed(data: Touched | PlanarGrasps) -> list[tuple[Grasp, Pose3]]:
    """The grasps with contacts, and where the object was."""
    pairs = zip(data.grasps, data.world_T_body, strict=True)
    return [(grasp, pose) for grasp, pose in pairs if grasp.contacts]


def _flat(transform: Pose3, points_m: Array) -> Array:
    """Points of shape (n, 2) or (n, 3) transformed within the plane, shape (n, 2)."""
    level = np.pad(points_m[:, :2], ((0, 0), (0, 1)))
    return np.asarray(transform_points(transform, level)[:, :2])


def _divided(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same surface in triangles small enough to be judged by their centres."""
    vertices, faces = trimesh.remesh.subdivide_to_size(  # type: ignore[no-untyped-call]
        mesh.vertices, mesh.faces, _LARGEST_EDGE_m, max_iter=12
    )
    return trimesh.Trimesh(vertices, faces, process=False)
