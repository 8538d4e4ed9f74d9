"""The field's trajectory error, and the files by which other programs compute it."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from tactile_lab.evaluation.files.tum_file import tum_text
from tactile_lab.evaluation.standard_error import best_rigid, standard_errors

RNG = np.random.default_rng(5)
TRUTH = [Pose3(Rot3.RzRyRx(*RNG.normal(size=3)), RNG.normal(size=3)) for _ in range(12)]
WORLD = Pose3(Rot3.RzRyRx(0.3, -0.5, 1.2), np.array([1.0, -2.0, 0.5]))
OBJECT_FRAME = Pose3(Rot3.Rz(0.4), np.array([0.03, 0.0, 0.01]))


def test_another_object_frame_is_no_error() -> None:
    found = standard_errors([pose * OBJECT_FRAME for pose in TRUTH], TRUTH)
    assert found is not None
    assert found.grasps == len(TRUTH)
    assert found.largest_mm < 1e-6
    assert found.rmse_deg == pytest.approx(0.0, abs=1e-5)


def test_the_alignment_removes_a_motion_of_the_world() -> None:
    places = np.array([pose.translation() for pose in TRUTH])
    found = best_rigid(np.array([WORLD.transformFrom(place) for place in places]), places)
    assert found.equals(WORLD.inverse(), 1e-9)


def test_a_displaced_pose_is_the_error_and_missing_ones_are_left_out() -> None:
    estimate: list[Pose3 | None] = list(TRUTH)
    estimate[5] = Pose3(TRUTH[5].rotation(), TRUTH[5].translation() + np.array([0.0, 0.0, 0.012]))
    estimate[7] = None
    found = standard_errors(estimate, TRUTH)
    assert found is not None
    assert found.grasps == len(TRUTH) - 1
    assert 8.0 < found.largest_mm < 12.0
    assert found.rmse_mm < 12.0 / np.sqrt(len(TRUTH) - 1)


def test_positions_on_a_line_leave_the_rotation_open() -> None:
    line = [Pose3(Rot3.Rx(0.2 * i), np.array([0.1 * i, 0.0, 0.0])) for i in range(4)]
    found = standard_errors(line, line)
    assert found is not None
    assert (found.rmse_mm < 1e-9, found.rmse_deg) == (True, None)
    assert standard_errors(line[:2], line[:2]) is None
    assert standard_errors(line[:3], line[:3]) is not None


def test_points_in_a_plane_are_not_mirrored() -> None:
    flat = np.column_stack([RNG.normal(size=(9, 2)), np.zeros(9)])
    target_T_source = best_rigid(flat, flat * [1.0, -1.0, 1.0])
    assert np.linalg.det(target_T_source.rotation().matrix()) == pytest.approx(1.0)


def test_the_text_format_has_seconds_metres_and_the_quaternion_with_w_last() -> None:
    pose = Pose3(Rot3.Rz(np.pi / 2), np.array([0.1, 0.2, 0.3]))
    head, line, end = tum_text([1.5, 2.5], [pose, None]).split("\n")
    assert head.startswith("#")
    assert [float(number) for number in line.split()] == pytest.approx([1.5, 0.1, 0.2, 0.3, 0, 0, 0.5**0.5, 0.5**0.5])
    assert end == ""
