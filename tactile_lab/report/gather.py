"""Reads a session folder into the content of its report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from drivers.core.contacts import Array
from drivers.core.poses import spatial, transform_points
from drivers.simulation.object_names import headline
from sessions.recording.manifest import Manifest
from sessions.recording.session import Session
from tactile_lab.evaluation.estimate_with_truth import Truth, true_outline
from tactile_lab.evaluation.files.mesh_io import read_estimated_mesh
from tactile_lab.evaluation.files.plain import read_json_object
from tactile_lab.evaluation.files.properties_file import read_measured
from tactile_lab.evaluation.files.results import Results, read_results
from tactile_lab.evaluation.files.tables import read_contour
from tactile_lab.evaluation.files.trajectory_file import read_trajectory
from tactile_lab.evaluation.shape import horizontal_outline
from tactile_lab.evaluation.truth.session_truth import TRUTH_TRAJECTORY, read_truth_mesh
from tactile_lab.report.camera_picture import last_view
from tactile_lab.report.content import ReportContent, SessionFacts, Surface, TrueShape, with_plain_lids
from tactile_lab.report.course import read_course
from tactile_lab.slam.shape.metrics.alignment import align_contours
from tactile_lab.slam.shape.surfaces.sampling import sample_polygon

SECTION_STEP_m = 0.002
_EVALUATE = "Run: tactile-lab evaluate"


def gather(session: Session, folder: Path) -> ReportContent:
    """Gather the content of a report from the session's manifest, its results and its evaluation.

    Args:
        session: the session.
        folder: its results, or those of a replay.

    Raises:
        SessionError: there are no results, a file is invalid, or the recording cannot be read.
        ShapeError: a mesh cannot be read.
    """
    results = read_results(folder)
    surface = _surface(folder / "mesh.ply", results.dimension)
    contour_m, sigma_m = _outline(folder, results, surface)
    truth = _truth(session, folder, results)
    camera, problem = last_view(session, results.trajectory.world_T_object)
    return ReportContent(
        facts=facts(session.manifest),
        results=results,
        evaluation=_evaluation(folder / "evaluation.json"),
        surface=surface,
        contour_m=contour_m,
        contour_sigma_m=sigma_m,
        truth=truth,
        fitted_outline_m=_fit(contour_m, truth),
        measured=read_measured(folder),
        course=read_course(session),
        camera=camera,
        camera_problem=problem,
    )


def facts(manifest: Manifest) -> SessionFacts:
    """The manifest of a session, as text."""
    plain_settings = {name: value for name, value in manifest.settings.items() if not isinstance(value, dict)}
    made_with = [
        ("session", manifest.name),
        ("object", manifest.object_name),
        *(("origin", step.words) for step in manifest.derived),
        *((f"seed: {name}", str(seed)) for name, seed in manifest.seeds.items()),
        *((f"setting: {name}", str(value)) for name, value in plain_settings.items()),
        *((f"version: {name}", number) for name, number in manifest.versions.items()),
    ]
    return SessionFacts(
        headline=headline(manifest.object_name),
        rig=manifest.rig,
        started=manifest.started_utc.replace("T", " ").replace("+00:00", " UTC"),
        status=manifest.status,
        notes=manifest.notes,
        problem=manifest.problem,
        made_with=tuple(made_with),
        calibrations=tuple((f"{role} ({copy.file})", copy.sha256) for role, copy in manifest.calibration.items()),
    )


def _evaluation(path: Path) -> dict[str, Any] | None:
    return read_json_object(path, hint=_EVALUATE) if path.is_file() else None


def _surface(path: Path, dimension: int) -> Surface | None:
    if not path.is_file():
        return None
    surface = read_surface(path)
    return surface if dimension == 3 else with_plain_lids(surface)


def read_surface(path: Path) -> Surface:
    """An estimated surface with the standard deviations in its file.

    Raises:
        ShapeError: not a mesh written by this program.
    """
    found = read_estimated_mesh(path)
    sigma_m = np.where(found.known, found.sigma_m, np.nan)
    mesh = found.mesh
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces), sigma_m, np.asarray(mesh.vertex_normals))


def _outline(folder: Path, results: Results, surface: Surface | None) -> tuple[Array | None, Array]:
    """The contour (in space the surface's section at the contacts) with its standard deviations."""
    if results.dimension == 2:
        return _contour(folder / "contour.csv", results)
    if surface is None:
        return None, np.zeros(0)
    mesh = trimesh.Trimesh(surface.vertices_m, surface.faces, process=False)
    # the object frame's origin is at the first contacts' mean height
    outline = sample_polygon(horizontal_outline(mesh, 0.0), SECTION_STEP_m)
    flat = np.column_stack([outline, np.zeros(len(outline))])
    _, nearest = cKDTree(surface.vertices_m).query(flat, k=4)
    return outline, surface.sigma_m[nearest].mean(axis=1)


def _contour(path: Path, results: Results) -> tuple[Array | None, Array]:
    if not path.is_file():
        return None, np.zeros(0)
    outline = read_contour(path)
    older = results.slam.get("contour_sigma_m") or ()  # where older results have them
    sigma_m = outline.sigma_m if len(outline.sigma_m) else np.array(older, dtype=float)
    return outline.points_m, np.where(outline.known, sigma_m, np.nan) if len(sigma_m) == len(outline.known) else sigma_m


def _truth(session: Session, folder: Path, results: Results) -> TrueShape | None:
    path = folder / TRUTH_TRAJECTORY
    if not path.is_file():
        return None
    truth = Truth(read_trajectory(path).world_T_object, read_truth_mesh(session))
    mesh = None if truth.mesh is None else (np.asarray(truth.mesh.vertices), np.asarray(truth.mesh.faces))
    return TrueShape(truth.world_T_object, mesh, true_outline(results, truth))


def _fit(contour_m: Array | None, truth: TrueShape | None) -> Array | None:
    """The true outline, fitted to the estimated one."""
    if contour_m is None or truth is None or truth.outline_m is None:
        return None
    estimate_T_truth = align_contours(truth.outline_m, contour_m)
    flat = np.column_stack([truth.outline_m, np.zeros(len(truth.outline_m))])
    return transform_points(spatial(estimate_T_truth), flat)[:, :2]
