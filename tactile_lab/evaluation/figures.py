"""The error metrics of an evaluation, in units for people: millimetres, degrees, shares.

Each is computed by a function registered in :data:`FIGURES`; extensions add theirs. A metric that cannot be computed is
null in the file, with the reason among the warnings; the others are not affected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from drivers.core.registry import Registry
from tactile_lab.evaluation.consistency.figures import consistency
from tactile_lab.evaluation.dimensions import dimensions
from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, seen_contacts
from tactile_lab.evaluation.files.plain import plain
from tactile_lab.evaluation.loops import wrong_loops
from tactile_lab.evaluation.registration import FAILURE_LIMIT_MM
from tactile_lab.evaluation.shape import contact_distances_m, outline_distances_m
from tactile_lab.evaluation.standard_error import StandardErrors, standard_errors
from tactile_lab.evaluation.trajectory import PoseErrors, pose_errors
from tactile_lab.slam.shape.metrics.metrics import ShapeErrors


@dataclass(frozen=True)
class ShapeFigures:
    """Shape errors for people: millimetres, and shares between 0 and 1."""

    hausdorff_mm: float
    mean_distance_mm: float
    chamfer_mm: float
    fscore_1mm: float
    fscore_2mm: float
    iou: float

    @classmethod
    def of(cls, errors: ShapeErrors | None) -> ShapeFigures | None:
        """The metrics from shape errors in metres."""
        if errors is None:
            return None
        return cls(
            hausdorff_mm=1e3 * errors.hausdorff_m,
            mean_distance_mm=1e3 * errors.mean_distance_m,
            chamfer_mm=1e3 * errors.chamfer_m,
            fscore_1mm=errors.fscore_1mm,
            fscore_2mm=errors.fscore_2mm,
            iou=errors.iou,
        )


@dataclass(frozen=True)
class LoopFigures:
    """Similar grasps: how many were tested, accepted, and how many of those were wrong (None without ground truth)."""

    tested: int
    accepted: int
    wrong: int | None


@dataclass(frozen=True)
class TimeFigures:
    """Computing time of the SLAM steps."""

    total_s: float | None
    step_ms_median: float | None
    step_ms_p95: float | None


@dataclass(frozen=True)
class SensingFigures:
    """Distance of the contacts from the true surface at the true pose: the error of the sensing alone."""

    median_mm: float
    p95_mm: float


@dataclass(frozen=True)
class UncertaintyFigures:
    """The estimated uncertainty: the standard deviation of the contour or surface, over all its points.

    Attributes:
        sigma_mm_median, sigma_mm_p95: of all errors together.
        shared_sigma_mm: median of the part that contacts of one finger share, which is one error for the whole session;
            None in results without it.
    """

    sigma_mm_median: float
    sigma_mm_p95: float
    shared_sigma_mm: float | None


@dataclass(frozen=True)
class TruthFigures:
    """Number of grasps with and without a true pose, and whether the true shape is known."""

    seen: int
    missing: int
    mesh: bool


Figure: TypeAlias = Callable[[EstimateWithTruth], Any]
"""Computes a metric: a number, or anything else that :func:`tactile_lab.evaluation.files.plain.plain` can write."""

FIGURES: Registry[Figure] = Registry("evaluation figure", group="figures")
"""All metrics by their name in ``evaluation.json``. See ``docs/extending.md`` for adding one."""


def computed(estimate: EstimateWithTruth) -> tuple[dict[str, Any], tuple[str, ...]]:
    """All registered metrics by name, None if one cannot be computed; and the reasons."""
    values: dict[str, Any] = {}
    warnings: list[str] = []
    for name in FIGURES:
        try:
            values[name] = FIGURES[name](estimate)
            plain(values[name])
            problem = "" if _is_finite(values[name]) else "is not a finite number"
        except (Exception, SystemExit) as error:
            problem = f"raises {FIGURES.explain(name, error)}"
        if problem:
            values[name] = None
            warnings.append(f"no {name}, as the evaluation figure {name} of {FIGURES.file(name)} {problem}")
    return values, tuple(warnings)


def _is_finite(value: Any) -> bool:
    """Whether it contains no NaN and no infinity; a record of metrics has None for unknown values."""
    if isinstance(value, Mapping):
        return all(map(_is_finite, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_is_finite, value))
    if isinstance(value, np.ndarray | np.generic):
        return bool(np.isfinite(value).all())
    return not isinstance(value, float) or math.isfinite(value)


# --- ours ----------------------------------------------------------------------------------------------------------


def _shape(estimate: EstimateWithTruth) -> ShapeFigures | None:
    """Errors with the estimate aligned with the truth at the first grasp."""
    compared, _ = estimate.shape
    return None if compared is None else ShapeFigures.of(compared.first_grasp)


def _shape_best_fit(estimate: EstimateWithTruth) -> ShapeFigures | None:
    compared, _ = estimate.shape
    return None if compared is None else ShapeFigures.of(compared.best_fit)


def _uncertainty(estimate: EstimateWithTruth) -> UncertaintyFigures | None:
    if (quantiles_m := estimate.results.sigma_quantiles_m) is None:
        return None
    median, p95 = 1e3 * np.percentile(quantiles_m, [50, 95])
    shared_m = estimate.results.slam.get("shared_sigma_m")
    return UncertaintyFigures(float(median), float(p95), None if shared_m is None else 1e3 * float(shared_m))


def _pose(estimate: EstimateWithTruth) -> PoseErrors | None:
    return pose_errors(estimate.poses, estimate.truth.world_T_object)


def _pose_umeyama(estimate: EstimateWithTruth) -> StandardErrors | None:
    return standard_errors(estimate.poses, estimate.truth.world_T_object)


def _registration(estimate: EstimateWithTruth) -> float | None:
    return estimate.registration_rms_mm


def _symmetry_turns(estimate: EstimateWithTruth) -> int | None:
    return estimate.symmetry_turns


def _sensing(estimate: EstimateWithTruth) -> SensingFigures | None:
    truth, seen = estimate.truth, seen_contacts(estimate.results, estimate.truth)
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


def _failed(estimate: EstimateWithTruth) -> bool | None:
    if estimate.results.status == "lost":
        return True
    error_mm = estimate.registration_rms_mm
    return None if error_mm is None else error_mm > FAILURE_LIMIT_MM


def _loops(estimate: EstimateWithTruth) -> LoopFigures:
    loops = estimate.results.slam["loops"]
    wrong = wrong_loops(loops, estimate.poses, estimate.truth.world_T_object)
    return LoopFigures(len(loops), sum(bool(loop["accepted"]) for loop in loops), wrong)


def _time(estimate: EstimateWithTruth) -> TimeFigures:
    if not (step_seconds := estimate.results.step_seconds):
        return TimeFigures(None, None, None)
    median, p95 = 1e3 * np.percentile(step_seconds, [50, 95])
    return TimeFigures(float(np.sum(step_seconds)), float(median), float(p95))


def _truth(estimate: EstimateWithTruth) -> TruthFigures:
    seen = sum(pose is not None for pose in estimate.truth.world_T_object)
    shape_known = estimate.truth.mesh is not None or estimate.truth.outline_m is not None
    return TruthFigures(seen, len(estimate.poses) - seen, shape_known)


FIGURES.register("shape", _shape)
FIGURES.register("shape_best_fit", _shape_best_fit)
FIGURES.register("uncertainty", _uncertainty)
FIGURES.register("dimensions", dimensions)
FIGURES.register("pose", _pose)
FIGURES.register("pose_umeyama", _pose_umeyama)
FIGURES.register("consistency", consistency)
FIGURES.register("registration_rms_mm", _registration)
FIGURES.register("symmetry_turns", _symmetry_turns)
FIGURES.register("sensing", _sensing)
FIGURES.register("failed", _failed)
FIGURES.register("loops", _loops)
FIGURES.register("time", _time)
FIGURES.register("truth", _truth)
