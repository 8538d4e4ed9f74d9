"""The evaluation as rows for people: the command line and the report print the same ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

UNKNOWN = "\u2013"


@dataclass(frozen=True)
class EvaluationRow:
    """One line: what it is, its value as text, its unit, and what it means."""

    label: str
    value: str
    unit: str
    note: str


def evaluation_rows(evaluation: Mapping[str, Any]) -> list[EvaluationRow]:
    """Rows from the content of ``evaluation.json``; what is unknown shows as a dash."""
    return [
        *_shape_rows(evaluation.get("shape") or {}, evaluation.get("shape_best_fit") or {}),
        *_pose_rows(evaluation.get("pose") or {}),
        *_run_rows(evaluation),
    ]


_SHAPE = (
    ("hausdorff_mm", "Hausdorff distance", "mm", 2, "largest distance between the two surfaces, both directions"),
    ("mean_distance_mm", "Mean distance", "mm", 2, "mean distance between the surfaces, both directions"),
    ("chamfer_mm", "Chamfer distance", "mm", 2, "sum of the two mean distances"),
    ("fscore_5mm", "F-score", "", 3, "share of both surfaces within 5 mm of the other"),
    ("iou", "Overlap", "", 3, "common part of both shapes over their union"),
)


def _shape_rows(first: Mapping[str, Any], best: Mapping[str, Any]) -> list[EvaluationRow]:
    return [
        EvaluationRow(label, _text(first.get(key), digits), unit, f"{note}; {_text(best.get(key), digits)} at best fit")
        for key, label, unit, digits, note in _SHAPE
    ]


_POSE = (
    ("rmse_mm", "Position error", "mm", 2, "RMS over the grasps after the aligned one"),
    ("rmse_deg", "Rotation error", "°", 2, "RMS over the grasps after the aligned one"),
    ("final_mm", "Final position error", "mm", 2, "at the last compared grasp"),
    ("final_deg", "Final rotation error", "°", 2, "at the last compared grasp"),
    ("drift_mm_per_grasp", "Position drift", "mm a grasp", 3, "slope of the error over the session"),
    ("drift_deg_per_grasp", "Rotation drift", "° a grasp", 3, "slope of the error over the session"),
    ("step_mm", "Step error, position", "mm", 2, "RMS error of the motion between grasps"),
    ("step_deg", "Step error, rotation", "°", 2, "RMS error of the motion between grasps"),
)


def _pose_rows(pose: Mapping[str, Any]) -> list[EvaluationRow]:
    return [EvaluationRow(label, _text(pose.get(key), digits), unit, note) for key, label, unit, digits, note in _POSE]


def _run_rows(evaluation: Mapping[str, Any]) -> list[EvaluationRow]:
    loops, time, truth = (evaluation.get(key) or {} for key in ("loops", "time", "truth"))
    verdict = {True: "failed: above 5 mm", False: "passed: at most 5 mm"}.get(evaluation.get("failed"), "not known")  # type: ignore[arg-type]
    seen, missing = truth.get("seen"), truth.get("missing")
    return [
        EvaluationRow("Registration error", _text(evaluation.get("registration_rms_mm"), 2), "mm", verdict),
        EvaluationRow("Contacts", _text(evaluation.get("contacts"), 0), "", f"in {evaluation.get('grasps')} grasps"),
        EvaluationRow("Loops accepted", _text(loops.get("accepted"), 0), "", _loop_note(loops)),
        EvaluationRow("Marker sightings", _text(seen, 0), "", f"{_text(missing, 0)} grasps without a sighting"),
        EvaluationRow("Step time", _text(time.get("step_ms_median"), 0), "ms", f"{_p95(time)} ms for the slowest 5 %"),
        EvaluationRow("SLAM time", _text(time.get("total_s"), 1), "s", "all steps together"),
        EvaluationRow("Status", str(evaluation.get("status", UNKNOWN)), "", "of the tracking"),
    ]


def _loop_note(loops: Mapping[str, Any]) -> str:
    return f"of {_text(loops.get('tested'), 0)} tested, {_text(loops.get('wrong'), 0)} of them wrong"


def _p95(time: Mapping[str, Any]) -> str:
    return _text(time.get("step_ms_p95"), 0)


def _text(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
