"""The evaluation as people read it: every figure with its digits, its unit and what it is of."""

from __future__ import annotations

from typing import Any

import pytest

from tactile_lab.evaluation.table import evaluation_rows, further_text, size_in_words

EVALUATION: dict[str, Any] = {
    "shape": {
        "hausdorff_mm": 3.456,
        "mean_distance_mm": 0.789,
        "chamfer_mm": 1.578,
        "fscore_1mm": 0.7654,
        "iou": 0.912,
    },
    "shape_best_fit": {"hausdorff_mm": 2.345, "mean_distance_mm": 0.678, "fscore_1mm": 0.8765},
    "dimensions": [{"name": "width", "mm": 60.24, "sigma_mm": 0.31, "true_mm": 60.0}],
    "pose": {
        "rmse_mm": 1.234,
        "final_mm": 2.344,
        "step_mm": 0.454,
        "drift_mm_per_grasp": 0.126,
        "rmse_deg": 2.006,
        "final_deg": 3.333,
        "step_deg": 0.111,
        "drift_deg_per_grasp": 0.222,
    },
    "pose_umeyama": {"rmse_mm": 1.005001, "largest_mm": 2.718, "rmse_deg": 0.557},
    "consistency": {
        "levels": [0.5, 0.95],
        "poses": {"inside": [0.4, 0.9], "nees": 1.234, "log_score": 5.678},
        "surface": {"inside": [0.55, 1.0], "signed_mm": -0.126, "log_score": 4.321},
    },
    "registration_rms_mm": 0.876,
    "sensing": {"median_mm": 0.345, "p95_mm": 1.236},
    "contacts": 20,
    "grasps": 4,
    "loops": {"tested": 6, "accepted": 3, "wrong": 1},
    "truth": {"seen": 3, "missing": 1},
    "time": {"step_ms_median": 123.4, "step_ms_p95": 456.7, "total_s": 1.26},
    "status": "complete",
    "known_share": 0.666,
    "further": {"roughness": 0.123456, "words": ["è"], "nothing": None},
}
SAID = {
    "Hausdorff distance": ("3.46", "mm", "2.35 at best fit; largest distance, both directions"),
    "Mean distance": ("0.79", "mm", "0.68 at best fit; mean of both directions"),
    "Chamfer distance": ("1.58", "mm", "\u2013 at best fit; sum of both mean distances"),
    "F-score at 1 mm": ("0.765", "", "0.876 at best fit; share of both surfaces within 1 mm"),
    "F-score at 2 mm": ("\u2013", "", "\u2013 at best fit; share of both surfaces within 2 mm"),
    "Overlap": ("0.912", "", "\u2013 at best fit; intersection over union"),
    "Width": ("60.2 \u00b1 0.6", "mm", "two standard deviations; true 60.0 mm"),
    "Position error": ("1.23", "mm", "RMS; 2.34 at the end, 0.45 between grasps, drift 0.13 per grasp"),
    "Rotation error": ("2.01", "\u00b0", "RMS; 3.33 at the end, 0.11 between grasps, drift 0.22 per grasp"),
    "Aligned position error": (
        *("1.01", "mm"),
        "RMS after the best rigid alignment (Umeyama); largest 2.72 mm, 0.56\u00b0 RMS",
    ),
    "Poses inside": (
        *("40 / 90", "%"),
        "of the stated 50 / 95 % regions, relative to the first grasp; NEES 1.23, log score 5.68",
    ),
    "Surface inside": (
        *("55 / 100", "%"),
        "of the stated 50 / 95 % regions, at best fit; mean error -0.13 mm, log score 4.32",
    ),
    "Contact error": ("0.34", "mm", "median to the true surface at the true pose; 95 % below 1.24 mm"),
    "Contacts": ("20", "", "in 4 grasps"),
    "Loops accepted": ("3", "", "of 6 tested, 1 of the accepted wrong"),
    "Marker sightings": ("3", "", "1 grasp without one"),
    "Step time": ("123", "ms", "median; 95 % below 457 ms, 1.3 s in total"),
    "Status": ("complete", "", "complete, partial, ambiguous or lost"),
    "Touched": ("67%", "", "of the shape; the rest is a guess"),
    "roughness": ("0.1235", "", "from an extension"),
    "words": ('["è"]', "", "from an extension"),
    "nothing": ("\u2013", "", "from an extension"),
}


def test_every_figure_is_said_with_its_digits_its_unit_and_what_it_is_of() -> None:
    rows = {row.label: (row.value, row.unit, row.note) for row in evaluation_rows(EVALUATION)}
    value, unit, _ = rows.pop("Registration error")
    assert (value, unit) == ("0.88", "mm")
    assert rows == SAID


def test_of_a_size_with_a_guessed_end_only_the_touched_span_has_an_uncertainty() -> None:
    guess = {"name": "length", "mm": 121.21, "sigma_mm": 40.0, "is_guess": True}
    touched = size_in_words(guess | {"touched_mm": 104.04, "touched_sigma_mm": 1.71})
    assert touched == ("\u2248 121.2", "touched over 104.0 \u00b1 3.4 mm, beyond is a guess")
    untouched = size_in_words(guess | {"touched_mm": None, "touched_sigma_mm": None})
    assert untouched == ("\u2248 121.2", "a guess, not touched")


def test_what_is_unknown_is_a_dash_without_a_unit() -> None:
    rows = {row.label: row for row in evaluation_rows({})}
    known = {"Contacts", "Marker sightings", "Status"}
    assert all((row.value, row.unit) == ("\u2013", "") for label, row in rows.items() if label not in known)
    assert rows["Position error"].note == "needs the true pose at two grasps"
    assert rows["Aligned position error"].note == "needs the true pose at three grasps"
    assert "Loops accepted" not in rows


@pytest.mark.parametrize(("value", "said"), [(None, "\u2013"), (1234567, "1.235e+06"), (True, "1"), ("a", '"a"')])
def test_a_figure_of_an_extension_is_shown_whatever_its_type(value: Any, said: str) -> None:
    assert further_text(value) == said
