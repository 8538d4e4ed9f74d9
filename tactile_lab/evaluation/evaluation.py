"""All error metrics of a session in one record, and its file ``evaluation.json``.

Estimates come from ``results/``; ground truth from the marker camera and the object's mesh. Unknown values (no camera,
no mesh, no shape) are None in the record and null in the file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from drivers.core.errors import SessionDataError
from tactile_lab.evaluation.consistency.figures import ConsistencyFigures
from tactile_lab.evaluation.dimensions import Extent
from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, Truth
from tactile_lab.evaluation.figures import (
    LoopFigures,
    SensingFigures,
    ShapeFigures,
    TimeFigures,
    TruthFigures,
    UncertaintyFigures,
    computed,
)
from tactile_lab.evaluation.files.plain import json_text, plain
from tactile_lab.evaluation.files.results import read_results
from tactile_lab.evaluation.result_warnings import result_warnings
from tactile_lab.evaluation.standard_error import StandardErrors
from tactile_lab.evaluation.trajectory import PoseErrors

SCHEMA_VERSION = 2
DECIMALS = 6


@dataclass(frozen=True)
class Evaluation:
    """Content of ``evaluation.json``, in this order.

    Attributes:
        aligned: how the estimate's object frame was aligned with the truth's for ``shape`` and ``pose``.
        shape: errors with that alignment.
        shape_best_fit: errors after the best rigid alignment.
        dimensions: length, width and, in space, height; None without a shape.
        pose_umeyama: the field's standard trajectory error, see :mod:`tactile_lab.evaluation.standard_error`.
        consistency: whether the stated uncertainties are true, see :mod:`tactile_lab.evaluation.consistency`.
        registration_rms_mm: see :func:`tactile_lab.evaluation.registration.registration_rms_mm`.
        symmetry_turns: rotations about the object's axis that leave it unchanged and do not count in the registration,
            see :func:`tactile_lab.evaluation.truth.rotational_symmetry.symmetry_turns`; None for none.
        uncertainty: see :class:`UncertaintyFigures`; None without a shape.
        sensing: see :class:`SensingFigures`; None without sightings or mesh.
        status: "complete", "partial", "ambiguous" or "lost", see :mod:`tactile_lab.slam.doubt.status`.
        known_share: share of the outline or surface that was touched, 0 to 1; None if unknown.
        doubts: name, words, grasps (from 0) of each reason to doubt the result, and whether it is grave.
        alternatives: other placings of grasps: their numbers, probability, largest turn and shift.
        failed: the object was lost or the registration error is above 5 mm; None if neither is known.
        warnings: why the result should not be trusted, as sentences.
        further: metrics of extensions by name; left out of the file if there are none.
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
    dimensions: tuple[Extent, ...] | None
    pose: PoseErrors | None
    pose_umeyama: StandardErrors | None
    consistency: ConsistencyFigures | None
    registration_rms_mm: float | None
    symmetry_turns: int | None
    sensing: SensingFigures | None
    failed: bool | None
    loops: LoopFigures | None
    time: TimeFigures | None
    truth: TruthFigures | None
    status: str
    known_share: float | None
    doubts: tuple[Mapping[str, Any], ...]
    alternatives: tuple[Mapping[str, Any], ...]
    warnings: tuple[str, ...]
    further: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Plain data, numbers rounded to six decimals."""
        content = _round(plain(self))
        assert isinstance(content, dict)
        return content if self.further else {key: item for key, item in content.items() if key != "further"}

    def as_text(self) -> str:
        """The text of ``evaluation.json``."""
        return json_text(self.as_json())


def evaluate(folder: Path, truth: Truth, object_name: str) -> Evaluation:
    """Evaluate the results in a folder.

    Args:
        folder: a session's ``results/``.
        truth: poses, one per grasp, and mesh.
        object_name: the name in the session.

    Raises:
        SessionError: results are missing or unreadable, or do not belong to the truth.
        ShapeError: the true mesh or contour cannot be compared.
    """
    estimate = EstimateWithTruth(folder, read_results(folder), truth)
    results, poses = estimate.results, estimate.poses
    if len(poses) != len(truth.world_T_object):
        counts = f"{len(poses)} grasps in the results, {len(truth.world_T_object)} in the session"
        raise SessionDataError(counts, where=str(folder), hint="Replay the session to update its results")
    _, incomparable = estimate.shape
    figures, failures = computed(estimate)
    ours = {each.name: figures.pop(each.name) for each in fields(Evaluation) if each.name in figures}
    return Evaluation(
        schema_version=SCHEMA_VERSION,
        method=str(results.slam["method"]),
        seed=int(results.slam["seed"]),
        object=object_name,
        dimension=results.dimension,
        grasps=len(poses),
        contacts=sum(len(rows.fingers) for rows in results.contacts),
        aligned="first_grasp",
        status=results.status,
        known_share=results.known_share,
        doubts=tuple(results.slam.get("doubts", ())),
        alternatives=tuple(map(_as_figures, results.slam.get("alternatives", ()))),
        warnings=(*result_warnings(results), *incomparable, *failures),
        further=figures,
        **ours,
    )


def _as_figures(alternative: Mapping[str, Any]) -> dict[str, Any]:
    """An alternative of ``slam.json`` for people: without its poses, in millimetres and degrees."""
    return {
        "grasps": alternative["grasps"],
        "probability": alternative["probability"],
        "turn_deg": math.degrees(alternative["turn_rad"]),
        "shift_mm": 1e3 * alternative["shift_m"],
        "rms_mm": 1e3 * alternative["rms_m"],
    }


def _round(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _round(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_round(item) for item in value]
    return round(value, DECIMALS) if isinstance(value, float) else value
