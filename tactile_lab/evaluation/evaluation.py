"""All error figures of a session in one record, and its file ``evaluation.json``.

Estimates come from ``results/``; truth is what the marker camera saw and the object's own mesh. What
cannot be known (no camera, no mesh, no shape) is None in the record and null in the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from gtsam import Pose3

from tactile_lab.errors import SessionError, ShapeError
from tactile_lab.evaluation.figures import (
    LoopFigures,
    SensingFigures,
    ShapeFigures,
    TimeFigures,
    TruthFigures,
    UncertaintyFigures,
)
from tactile_lab.evaluation.loops import wrong_loops
from tactile_lab.evaluation.own_turns import own_turns, without_own_turns
from tactile_lab.evaluation.plain import json_text, plain
from tactile_lab.evaluation.registration import FAILURE_LIMIT_MM, registration_rms_mm
from tactile_lab.evaluation.reservations import reservations
from tactile_lab.evaluation.results import Results, read_results
from tactile_lab.evaluation.shape import (
    ShapeComparison,
    compare_contour,
    compare_mesh,
    contact_distances_m,
    contact_height_m,
    horizontal_outline,
    outline_distances_m,
)
from tactile_lab.evaluation.tables import read_contour
from tactile_lab.evaluation.trajectory import PoseErrors, compared_grasps, estimate_T_truth, pose_errors
from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.mesh_io import read_mesh

SCHEMA_VERSION = 1
DECIMALS = 6


@dataclass(frozen=True)
class Truth:
    """What only evaluation may know.

    Attributes:
        world_T_object: the object's pose at each grasp by the marker camera, None where it was not seen.
        mesh: the object's surface in the truth's object frame, or None.
        outline_m: its horizontal outline in that frame, shape (n, 2), where that is what is known of it.
    """

    world_T_object: tuple[Pose3 | None, ...]
    mesh: trimesh.Trimesh | None = None
    outline_m: Array | None = None


@dataclass(frozen=True)
class Evaluation:
    """Content of ``evaluation.json``, in its order.

    Attributes:
        aligned: how the estimate's object frame was tied to the truth's for ``shape`` and ``pose``.
        shape: errors with that alignment.
        shape_best_fit: errors after the best rigid alignment.
        registration_rms_mm: see :func:`tactile_lab.evaluation.registration.registration_rms_mm`.
        own_turns: turns about its axis that leave the object as it is and do not count in the registration, see
            :func:`tactile_lab.evaluation.own_turns.own_turns`; None for none.
        uncertainty: see :class:`UncertaintyFigures`; None without a shape.
        sensing: see :class:`SensingFigures`; None without sightings or mesh.
        failed: the object was lost or the registration error is above 5 mm; None when neither is known.
        warnings: why the result should not be believed as it stands, in words.
    """

    schema_version: int
    method: str
    seed: int
    object: str
    dimension: int
    grasps: int
    contacts: int
    aligned: str
    shape: ShapeFigures | None
    shape_best_fit: ShapeFigures | None
    uncertainty: UncertaintyFigures | None
    pose: PoseErrors | None
    registration_rms_mm: float | None
    own_turns: int | None
    sensing: SensingFigures | None
    failed: bool | None
    loops: LoopFigures
    time: TimeFigures
    truth: TruthFigures
    status: str
    warnings: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain data, numbers rounded to six decimals."""
        content = _rounded(plain(self))
        assert isinstance(content, dict)
        return content

    def as_text(self) -> str:
        """The text of ``evaluation.json``."""
        return json_text(self.as_json())


def evaluate(folder: Path, truth: Truth, object_name: str) -> Evaluation:
    """Judge the results in a folder.

    Args:
        folder: a session's ``results/``.
        truth: poses, one a grasp, and mesh.
        object_name: as the session calls it.

    Raises:
        SessionError: results are missing or unreadable, or do not belong to the truth.
        ShapeError: a true mesh or contour that can not be compared.
    """
    results = read_results(folder)
    poses, contacts = results.trajectory.world_T_object, results.contacts
    if len(poses) != len(truth.world_T_object):
        counts = f"{len(poses)} grasps in the results, {len(truth.world_T_object)} in the session"
        raise SessionError(counts, where=str(folder), hint="Replay the session to renew its results")
    shape, incomparable = _shape(folder, results, truth)
    points = [rows.points_world_m for rows in contacts]
    turns = None if truth.mesh is None else own_turns(truth.mesh)
    told = without_own_turns(poses, truth.world_T_object, turns)
    registration_mm = registration_rms_mm(points, told, truth.world_T_object, results.dimension)
    seen = sum(pose is not None for pose in truth.world_T_object)
    shape_known = truth.mesh is not None or truth.outline_m is not None
    return Evaluation(
        schema_version=SCHEMA_VERSION,
        method=str(results.slam["method"]),
        seed=int(results.slam["seed"]),
        object=object_name,
        dimension=results.dimension,
        grasps=len(poses),
        contacts=sum(len(rows.fingers) for rows in contacts),
        aligned="first_grasp",
        shape=None if shape is None else ShapeFigures.of(shape.first_grasp),
        shape_best_fit=None if shape is None else ShapeFigures.of(shape.best_fit),
        uncertainty=_uncertainty(results.sigma_quantiles_m),
        pose=pose_errors(poses, truth.world_T_object),
        registration_rms_mm=registration_mm,
        own_turns=turns,
        sensing=_sensing(results, truth),
        failed=_failed(str(results.slam["status"]), registration_mm),
        loops=_loops(results, truth),
        time=_time(results.step_seconds),
        truth=TruthFigures(seen, len(poses) - seen, shape_known),
        status=str(results.slam["status"]),
        warnings=(*reservations(results), *incomparable),
    )


def _shape(folder: Path, results: Results, truth: Truth) -> tuple[ShapeComparison | None, tuple[str, ...]]:
    """The comparison of contour or mesh with the truth, None where one of them is missing; and why there is none."""
    name = "contour.csv" if results.dimension == 2 else "mesh.ply"
    if not (folder / name).is_file():
        return None, ()
    alignment = estimate_T_truth(results.trajectory.world_T_object, truth.world_T_object)
    truth_T_estimate = None if alignment is None else alignment.inverse()
    if results.dimension == 3:
        return (None, ()) if truth.mesh is None else _surface(folder / name, truth.mesh, truth_T_estimate)
    outline = true_outline(results, truth)
    compared = None if outline is None else compare_contour(read_contour(folder / name)[:-1], outline, truth_T_estimate)
    return compared, ()


def _surface(
    path: Path, truth: trimesh.Trimesh, truth_T_estimate: Pose3 | None
) -> tuple[ShapeComparison | None, tuple[str, ...]]:
    """A surface that is wildly wrong is a result too: no figures, and a word why."""
    try:
        mesh = read_mesh(path)
    except ShapeError as error:
        return None, (f"the estimated surface can not be compared: it {error.what}",)
    return compare_mesh(mesh, truth, truth_T_estimate), ()


def true_outline(results: Results, truth: Truth) -> Array | None:
    """The true outline, shape (n, 2), truth's object frame: as given, or the mesh's section at the contacts' height.

    That is their mean height; half the mesh's where no true pose tells it.
    """
    if truth.outline_m is not None:
        return truth.outline_m
    if truth.mesh is None:
        return None
    points, poses = _seen_contacts(results, truth)
    known = any(len(found) for found in points)
    height_m = contact_height_m(points, poses) if known else float(truth.mesh.bounds[:, 2].mean())
    return horizontal_outline(truth.mesh, height_m)


def _seen_contacts(results: Results, truth: Truth) -> tuple[list[Array], list[Pose3]]:
    """World contacts and true pose of every grasp that the camera saw."""
    pairs = compared_grasps(truth.world_T_object, truth.world_T_object)
    return [results.contacts[pair.index].points_world_m for pair in pairs], [pair.truth for pair in pairs]


def _sensing(results: Results, truth: Truth) -> SensingFigures | None:
    seen = _seen_contacts(results, truth)
    if truth.mesh is not None:
        distances_m = contact_distances_m(*seen, truth.mesh)
    elif truth.outline_m is not None:
        distances_m = outline_distances_m(*seen, truth.outline_m)
    else:
        return None
    if not len(distances_m):
        return None
    median, p95 = 1e3 * np.percentile(distances_m, [50, 95])
    return SensingFigures(float(median), float(p95))


def _uncertainty(quantiles_m: Array | None) -> UncertaintyFigures | None:
    if quantiles_m is None:
        return None
    median, p95 = 1e3 * np.percentile(quantiles_m, [50, 95])
    return UncertaintyFigures(float(median), float(p95))


def _failed(status: str, registration_mm: float | None) -> bool | None:
    if status != "ok":
        return True
    return None if registration_mm is None else registration_mm > FAILURE_LIMIT_MM


def _loops(results: Results, truth: Truth) -> LoopFigures:
    loops = results.slam["loops"]
    wrong = wrong_loops(loops, results.trajectory.world_T_object, truth.world_T_object)
    return LoopFigures(len(loops), sum(bool(loop["accepted"]) for loop in loops), wrong)


def _time(step_seconds: Sequence[float]) -> TimeFigures:
    if not step_seconds:
        return TimeFigures(None, None, None)
    median, p95 = 1e3 * np.percentile(step_seconds, [50, 95])
    return TimeFigures(float(np.sum(step_seconds)), float(median), float(p95))


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    return round(value, DECIMALS) if isinstance(value, float) else value
