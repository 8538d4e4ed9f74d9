"""The files that a session's SLAM writes to ``results/``.

==================  ===============================================================================
``trajectory.csv``  stamp, 16 entries of ``world_T_object`` and its covariance a grasp; empty where not placed
``contacts.csv``    every contact in the world frame, with its grasp, finger, force and uncertainty
``contour.csv``     dimension 2: the outer contour in the object frame, closed, with its standard deviation
``mesh.ply/.glb``   the shape in the object frame with per-vertex ``sigma_m``; in dimension 2 the contour
                    extruded from the table to the highest contact
``known.csv/.ply``  on wish: the parts of the contour or surface whose standard deviation is small enough
``slam.json``       method, seed, settings, what happened in each step, every loop with its verdict
``timing.json``     seconds a step: the only file that two runs of one session do not share
==================  ===============================================================================

All except ``timing.json`` depend on the result only: the same result gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.atomic_files import write_whole
from drivers.core.contacts import Array, Grasp
from tactile_lab.evaluation.consistency.pose_covariance import covariances_in_world
from tactile_lab.evaluation.files.mesh_io import write_glb, write_ply
from tactile_lab.evaluation.files.plain import json_text, plain
from tactile_lab.evaluation.files.tables import NANOSECOND_s, contacts_text, contour_text, pieces_text
from tactile_lab.evaluation.files.trajectory_file import Trajectory, trajectory_text
from tactile_lab.evaluation.prism import Triangles, open_ring, prism
from tactile_lab.slam.result import SlamResult, SlamStep
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh, supported_mesh, supported_pieces

SCHEMA_VERSION = 1
_LEAST_HEIGHT_m = 0.001


def write_results(
    folder: Path,
    result: SlamResult,
    grasps: Sequence[Grasp],
    settings: Mapping[str, Any] | None = None,
    largest_sigma_m: float | None = None,
) -> list[Path]:
    """Write all result files of one SLAM run. Returns the files written, in the order of the table above.

    Args:
        folder: the session's ``results/`` folder, created if missing.
        result: the finished run.
        grasps: its grasps, in order.
        settings: the SLAM settings, stored in ``slam.json``.
        largest_sigma_m: also write the part of the shape with a standard deviation below this to a separate file; None:
            do not.

    Raises:
        WriteError: the folder cannot be written.
    """
    stamps_s = tuple(grasp.stamp_ns * NANOSECOND_s for grasp in grasps)
    trajectory = Trajectory(stamps_s, tuple(result.world_T_object), covariances_in_world(result))
    texts = {
        "trajectory.csv": trajectory_text(trajectory),
        "contacts.csv": contacts_text(grasps),
        **({} if result.contour is None else {"contour.csv": _contour_text(result.contour)}),
        **_known_contour(result, largest_sigma_m),
        "slam.json": json_text(_slam_record(result, settings or {})),
        "timing.json": json_text({"schema_version": SCHEMA_VERSION, "step_seconds": result.step_seconds}),
    }
    for name, text in texts.items():
        write_whole(folder / name, text)
    meshes = [*_write_mesh(folder, result, grasps), *_write_known_mesh(folder, result, largest_sigma_m)]
    return [*(folder / name for name in texts), *meshes]


def _write_mesh(folder: Path, result: SlamResult, grasps: Sequence[Grasp]) -> list[Path]:
    mesh = result.mesh if result.mesh is not None else upright_contour(result, grasps)
    if mesh is None:
        return []
    paths = [folder / "mesh.ply", folder / "mesh.glb"]
    write_ply(paths[0], mesh)
    write_glb(paths[1], mesh)
    return paths


def _known_contour(result: SlamResult, largest_sigma_m: float | None) -> dict[str, str]:
    if result.contour is None or largest_sigma_m is None:
        return {}
    return {"known.csv": pieces_text([piece.points_m for piece in supported_pieces(result.contour, largest_sigma_m)])}


def _write_known_mesh(folder: Path, result: SlamResult, largest_sigma_m: float | None) -> list[Path]:
    if result.mesh is None or largest_sigma_m is None:
        return []
    write_ply(folder / "known.ply", supported_mesh(result.mesh, largest_sigma_m))
    return [folder / "known.ply"]


def upright_contour(result: SlamResult, grasps: Sequence[Grasp]) -> SurfaceMesh | None:
    """The contour extruded from the table to the highest contact, in the object frame; None without a contour.

    A planar session does not measure the top; the highest contact is the known height of the object. A planar contact
    log has no heights, and gets no solid.
    """
    heights = np.concatenate([grasp.points_world_m[:, 2] for grasp in grasps] or [np.zeros(0)])
    placed = next((pose for pose in result.world_T_object if pose is not None), None)
    if result.contour is None or placed is None or not heights.size or heights.max() < _LEAST_HEIGHT_m:
        return None
    ring, nearest = _ring_of(result.contour)
    sigma_m, known = result.contour.sigma_m[nearest], result.contour.known
    origin_m = float(placed.z())
    vertices, faces = prism(ring, -origin_m, float(heights.max()) - origin_m)
    normals = _vertex_normals(vertices, faces)
    touched = None if known is None else np.tile(known[nearest], 2)
    return SurfaceMesh(vertices, faces, np.tile(sigma_m, 2), normals, result.contour.is_closed, touched)


def _ring_of(contour: Contour) -> tuple[Array, NDArray[np.intp]]:
    """The contour as in ``contour.csv``, and the index of the contour's point at each of its points."""
    ring = open_ring(contour.points_m)
    return ring, np.argmin(np.sum((ring[:, None] - contour.points_m[None]) ** 2, axis=2), axis=1)


def _contour_text(contour: Contour) -> str:
    ring, nearest = _ring_of(contour)
    return contour_text(ring, contour.sigma_m[nearest], None if contour.known is None else contour.known[nearest])


def _vertex_normals(vertices: Array, faces: Triangles) -> Array:
    """Area weighted mean normals of the faces at each vertex, shape (n, 3)."""
    corners = vertices[faces]
    area_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    np.add.at(normals, faces.ravel(), np.repeat(area_normals, 3, axis=0))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-30))


def _slam_record(result: SlamResult, settings: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "method": result.method,
        "seed": result.seed,
        "dimension": result.dimension,
        "status": result.status,
        "known_share": result.known_share,
        "doubts": result.doubts,
        "alternatives": result.alternatives,
        **({"warnings": result.warnings} if result.warnings else {}),
        "settings": settings,
        "steps": [_without_duration(step) for step in result.steps],
        "covariances": result.covariances,
        "common_covariances": result.common_covariances,
        "loops": result.loops,
        "sigma_quantiles_m": _sigma_quantiles(result),
        "shared_sigma_m": None if (shape := _shape(result)) is None else shape.shared_sigma_m,
    }


def _sigma_quantiles(result: SlamResult) -> Array | None:
    """Standard deviation of the contour or surface, as percentiles from smallest to largest."""
    shape = _shape(result)
    return None if shape is None else np.quantile(shape.sigma_m, np.linspace(0.0, 1.0, 101))


def _shape(result: SlamResult) -> Contour | SurfaceMesh | None:
    return result.contour if result.contour is not None else result.mesh


def _without_duration(step: SlamStep) -> dict[str, Any]:
    return {key: value for key, value in plain(step).items() if key != "seconds"}
