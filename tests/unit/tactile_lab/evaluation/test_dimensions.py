"""Outer sizes: which way is long, and how uncertain they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.contacts import Array
from tactile_lab.evaluation.dimensions import dimensions
from tactile_lab.evaluation.estimate_with_truth import EstimateWithTruth, Truth
from tactile_lab.evaluation.files.results import Results
from tactile_lab.evaluation.files.tables import ContactRows, contour_text
from tactile_lab.evaluation.files.trajectory_file import Trajectory

TURN = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
RECTANGLE = np.array([[0.05, 0.03], [-0.05, 0.03], [-0.05, -0.03], [0.05, -0.03]]) @ TURN.T


def estimated(
    folder: Path, ring_m: Array, sigma_m: Array, truth_m: Array | None, known: Array | None = None
) -> EstimateWithTruth:
    (folder / "contour.csv").write_text(contour_text(ring_m, sigma_m, known))
    corners_m = np.column_stack([ring_m, np.zeros(len(ring_m))])
    each = np.full(len(ring_m), 0.001)
    rows = ContactRows(("FF",) * len(ring_m), corners_m, np.tile([1.0, 0.0, 0.0], (len(ring_m), 1)), each, each, each)
    results = Results(Trajectory((0.0,), (Pose3(),)), (rows,), {"dimension": 2}, ())
    return EstimateWithTruth(folder, results, Truth((Pose3(),), outline_m=truth_m))


def test_a_turned_rectangle_is_measured_along_its_sides(tmp_path: Path) -> None:
    sigma_m = np.array([0.001, 0.001, 0.0002, 0.0002])
    found = dimensions(estimated(tmp_path, RECTANGLE, sigma_m, 1.1 * RECTANGLE))
    assert found is not None
    length, width = found
    assert (length.name, width.name) == ("length", "width")
    assert (length.mm, width.mm) == pytest.approx((100.0, 60.0))
    assert (length.true_mm, width.true_mm) == pytest.approx((110.0, 66.0))
    assert width.sigma_mm == pytest.approx(1.0 + 0.2)


def test_what_the_files_say_of_touched_places_is_heard(tmp_path: Path) -> None:
    known, sigma_m = np.array([True, False, False, True]), np.array([0.0004, 0.040, 0.040, 0.0004])
    found = dimensions(estimated(tmp_path, RECTANGLE, sigma_m, None, known))
    assert found is not None
    length, width = found
    assert (length.is_guess, width.is_guess) == (True, False)
    assert width.sigma_mm == pytest.approx(0.4 + 0.4)
    assert (length.touched_mm, width.touched_mm) == pytest.approx((0.0, 60.0))


def test_without_truth_only_the_estimate_is_known_and_without_a_shape_nothing(tmp_path: Path) -> None:
    found = dimensions(estimated(tmp_path, RECTANGLE, np.full(4, 0.001), None))
    assert found is not None
    assert {extent.true_mm for extent in found} == {None}
    nothing = estimated(tmp_path, RECTANGLE, np.full(4, 0.001), None)
    (tmp_path / "contour.csv").unlink()
    assert dimensions(nothing) is None
