"""The evaluation as rows for people, shared by command line and report."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tactile_lab.evaluation.registration import registration_verdict

UNKNOWN = "\u2013"
NEEDS_TWO = "needs the true pose at two grasps"
_PREVAILING = 0.5
"""Share of the variance from which on a surface errs as a whole."""


@dataclass(frozen=True)
class EvaluationRow:
    """One line: label, value as text, unit, and explanation."""

    label: str
    value: str
    unit: str
    note: str


def evaluation_rows(evaluation: Mapping[str, Any]) -> list[EvaluationRow]:
    """Rows from the content of ``evaluation.json``; unknown values show as a dash."""
    rows = [
        *_shape_rows(evaluation.get("shape") or {}, evaluation.get("shape_best_fit") or {}),
        *_size_rows(evaluation.get("dimensions") or ()),
        *_pose_rows(evaluation.get("pose") or {}),
        _standard_row(evaluation.get("pose_umeyama") or {}),
        *_consistency_rows(evaluation.get("consistency") or {}, evaluation.get("uncertainty") or {}),
        *_run_rows(evaluation),
        *_further_rows(evaluation.get("further") or {}),
    ]
    return [replace(row, unit="") if row.value == UNKNOWN else row for row in rows]


_SHAPE = (
    ("hausdorff_mm", "Hausdorff distance", "mm", 2, "largest distance, both directions"),
    ("mean_distance_mm", "Mean distance", "mm", 2, "mean of both directions"),
    ("chamfer_mm", "Chamfer distance", "mm", 2, "sum of both mean distances"),
    ("fscore_1mm", "F-score at 1 mm", "", 3, "share of both surfaces within 1 mm"),
    ("fscore_2mm", "F-score at 2 mm", "", 3, "share of both surfaces within 2 mm"),
    ("iou", "Overlap", "", 3, "intersection over union"),
)


def _shape_rows(first: Mapping[str, Any], best: Mapping[str, Any]) -> list[EvaluationRow]:
    return [
        EvaluationRow(label, _text(first.get(key), digits), unit, f"{_text(best.get(key), digits)} at best fit; {note}")
        for key, label, unit, digits, note in _SHAPE
    ]


def _size_rows(extents: Sequence[Mapping[str, Any]]) -> list[EvaluationRow]:
    told = [(str(extent["name"]).capitalize(), extent, *size_in_words(extent)) for extent in extents]
    return [
        EvaluationRow(name, value, "mm", f"{note}; true {_text(extent.get('true_mm'), 1)} mm")
        for name, extent, value, note in told
    ]


def size_in_words(extent: Mapping[str, Any]) -> tuple[str, str]:
    """An outer size of ``evaluation.json`` in millimetres, and what is known of it.

    Touched at both ends it has its own uncertainty. Otherwise what is known is the touched span; the standard deviation
    of a guess tells how far the model may be wrong where nobody felt, which is not how well the object is known.
    """
    if not extent.get("is_guess"):
        return f"{extent['mm']:.1f} \u00b1 {2 * extent['sigma_mm']:.1f}", "two standard deviations"
    if extent["touched_mm"] is None:
        return f"\u2248 {extent['mm']:.1f}", "a guess, not touched"
    touched = f"{extent['touched_mm']:.1f} \u00b1 {2 * extent['touched_sigma_mm']:.1f} mm"
    return f"\u2248 {extent['mm']:.1f}", f"touched over {touched}, beyond is a guess"


def _pose_rows(pose: Mapping[str, Any]) -> list[EvaluationRow]:
    return [_pose_row("Position error", "mm", pose), _pose_row("Rotation error", "deg", pose)]


def _pose_row(label: str, unit: str, pose: Mapping[str, Any]) -> EvaluationRow:
    rmse, final, step, drift = (
        _text(pose.get(key), 2) for key in (f"rmse_{unit}", f"final_{unit}", f"step_{unit}", f"drift_{unit}_per_grasp")
    )
    if not pose:
        return EvaluationRow(label, UNKNOWN, "", NEEDS_TWO)
    note = f"RMS; {final} at the end, {step} between grasps, drift {drift} per grasp"
    return EvaluationRow(label, rmse, {"deg": "°"}.get(unit, unit), note)


def _standard_row(errors: Mapping[str, Any]) -> EvaluationRow:
    if not errors:
        return EvaluationRow("Aligned position error", UNKNOWN, "", "needs the true pose at three grasps")
    turned = "" if errors.get("rmse_deg") is None else f", {_text(errors['rmse_deg'], 2)}° RMS"
    note = f"RMS after the best rigid alignment (Umeyama); largest {_text(errors.get('largest_mm'), 2)} mm{turned}"
    return EvaluationRow("Aligned position error", _text(errors.get("rmse_mm"), 2), "mm", note)


_JUDGED = (
    ("poses", "Poses inside", "relative to the first grasp"),
    ("poses_common", "Poses inside", "relative to the best common frame"),
    ("surface", "Surface inside", "at best fit"),
)


def _consistency_rows(consistency: Mapping[str, Any], uncertainty: Mapping[str, Any]) -> list[EvaluationRow]:
    """Coverage of each kind of statement that could be judged."""
    levels = consistency.get("levels") or ()
    stated = " / ".join(f"{100 * level:.0f}" for level in levels)
    rows = []
    for key, label, basis in _JUDGED:
        if found := consistency.get(key):
            inside = " / ".join(f"{100 * share:.0f}" for share in found["inside"])
            rows.append(
                EvaluationRow(label, inside, "%", f"of the stated {stated} % regions, {basis}; {_scored(found)}")
            )
            if key == "surface" and (words := one_draw(uncertainty)):
                rows[-1] = replace(rows[-1], note=f"{rows[-1].note}; {words}")
    return rows


def _scored(found: Mapping[str, Any]) -> str:
    """Normalised error of poses or mean signed error of a surface, and the log score."""
    own = f"NEES {_text(found['nees'], 2)}" if "nees" in found else f"mean error {found['signed_mm']:+.2f} mm"
    return f"{own}, log score {_text(found['log_score'], 2)}"


def _run_rows(evaluation: Mapping[str, Any]) -> list[EvaluationRow]:
    loops, time, truth = (evaluation.get(key) or {} for key in ("loops", "time", "truth"))
    sensing = evaluation.get("sensing") or {}
    grasps, missing = evaluation.get("grasps", 0), truth.get("missing", 0)
    spread = f"median; 95 % below {_text(time.get('step_ms_p95'), 0)} ms, {_text(time.get('total_s'), 1)} s in total"
    return [
        EvaluationRow(
            "Registration error", _text(evaluation.get("registration_rms_mm"), 2), "mm", _verdict(evaluation)
        ),
        EvaluationRow("Contact error", _text(sensing.get("median_mm"), 2), "mm", _sensing_note(sensing)),
        EvaluationRow("Contacts", _text(evaluation.get("contacts"), 0), "", f"in {_of('grasp', grasps)}"),
        *(
            [EvaluationRow("Loops accepted", _text(loops["accepted"], 0), "", _loop_note(loops))]
            if loops.get("tested")
            else []
        ),
        EvaluationRow("Marker sightings", _text(truth.get("seen"), 0), "", f"{_of('grasp', missing)} without one"),
        EvaluationRow("Step time", _text(time.get("step_ms_median"), 0), "ms", spread),
        EvaluationRow("Status", str(evaluation.get("status", UNKNOWN)), "", "complete, partial, ambiguous or lost"),
        EvaluationRow("Touched", _percent(evaluation.get("known_share")), "", "of the shape; the rest is a guess"),
    ]


def _further_rows(further: Mapping[str, Any]) -> list[EvaluationRow]:
    return [EvaluationRow(name, further_text(value), "", "from an extension") for name, value in further.items()]


def one_draw(uncertainty: Mapping[str, Any]) -> str:
    """Words beside the share of a surface inside its regions, if errors that a session has once prevail; else empty.

    Args:
        uncertainty: as in ``evaluation.json``; empty without a shape.
    """
    shared_mm, sigma_mm = uncertainty.get("shared_sigma_mm"), uncertainty.get("sigma_mm_median")
    if shared_mm is None or sigma_mm is None or shared_mm**2 < _PREVAILING * sigma_mm**2:
        return ""
    return f"one draw: {shared_mm:.2f} of the {sigma_mm:.2f} mm of sigma is one error a finger, all session"


def further_text(value: Any) -> str:
    """A metric of an extension, of any type; a dash if it is unknown."""
    if value is None:
        return UNKNOWN
    return f"{value:.4g}" if isinstance(value, int | float) else json.dumps(value, ensure_ascii=False)


def _of(what: str, count: int) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _sensing_note(sensing: Mapping[str, Any]) -> str:
    return f"median to the true surface at the true pose; 95 % below {_text(sensing.get('p95_mm'), 2)} mm"


def _verdict(evaluation: Mapping[str, Any]) -> str:
    if evaluation.get("registration_rms_mm") is None:
        return NEEDS_TWO
    return registration_verdict(evaluation["registration_rms_mm"], evaluation.get("symmetry_turns"))[1]


def _loop_note(loops: Mapping[str, Any]) -> str:
    return f"of {_text(loops.get('tested'), 0)} tested, {_text(loops.get('wrong'), 0)} of the accepted wrong"


def _percent(share: float | None) -> str:
    return UNKNOWN if share is None else f"{share:.0%}"


def _text(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
