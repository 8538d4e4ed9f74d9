"""Coverage of stated surface uncertainty: weights, signs, calibration curve."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from gtsam import Pose2, Pose3, Rot3

from tactile_lab.evaluation.consistency.levels import CURVE, LEVELS
from tactile_lab.evaluation.consistency.surfaces import mesh_consistency, outline_consistency, surface_consistency

BOX = trimesh.creation.box((0.1, 0.06, 0.04))


def test_normal_errors_give_the_diagonal_as_calibration_curve() -> None:
    sigma_m = np.full(4000, 0.001)
    errors_m = np.random.default_rng(2).normal(0.0, sigma_m)
    found = surface_consistency(errors_m, sigma_m)
    assert found.curve == pytest.approx(CURVE, abs=0.02)
    assert found.inside == pytest.approx(LEVELS, abs=0.02)
    bold = surface_consistency(errors_m, 0.2 * sigma_m)
    shy = surface_consistency(errors_m, 5.0 * sigma_m)
    assert bold.inside[2] < 0.5
    assert shy.inside[0] > 0.95
    assert max(bold.log_score, shy.log_score) < found.log_score


def test_a_standard_deviation_between_two_points_is_interpolated() -> None:
    square = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    bigger, sigma_m = 1.02 * square, np.array([0.0001, 0.001, 0.0001, 0.001])
    found = outline_consistency(bigger, sigma_m, square, Pose2())
    assert found.signed_mm == pytest.approx(1.0, abs=0.02)
    assert 0.25 < found.inside[2] < 0.8
    assert mesh_consistency(BOX, np.full(8, 0.001), BOX, Pose3()).inside == (1.0, 1.0, 1.0)


def test_a_guess_does_not_displace_what_is_known() -> None:
    square = 0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 0.8], [1.0, 1.0], [0.8, 1.0], [-1.0, 1.0]])
    guessed, sigma_m = square.copy(), np.full(6, 0.0002)
    guessed[3] *= 1.3
    sure = outline_consistency(guessed, sigma_m, square, Pose2())
    sigma_m[3] = 0.02
    told = outline_consistency(guessed, sigma_m, square, Pose2())
    assert told.inside[2] > 0.95 > 0.7 > sure.inside[2]


def test_a_shape_is_judged_wherever_it_was_put() -> None:
    moved = outline_consistency(
        0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 0.6], [-1.0, 0.6]]) + [0.003, 0.002],
        np.full(4, 0.0005),
        0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 0.6], [-1.0, 0.6]]),
        Pose2(0.0, 0.0, 0.02),
    )
    assert moved.inside == (1.0, 1.0, 1.0)
    assert moved.log_score > 6.6
    held = mesh_consistency(
        BOX, np.full(8, 0.0005), BOX, Pose3(Rot3.Ypr(0.01, 0.02, -0.01), [0.001, 0, 0]), upright=False
    )
    assert held.inside == (1.0, 1.0, 1.0)


def test_a_long_side_counts_more_than_many_points_on_a_short_one() -> None:
    corners = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.02], [0.0, 0.02]])
    crowded = np.vstack([corners[:3], np.column_stack([np.linspace(0.1, 0.0, 200)[1:], np.full(199, 0.02)])])
    shifted = crowded + np.array([0.0, 0.001])  # the long sides are off by 1 mm, one outward and one inward
    found = outline_consistency(shifted, np.full(len(shifted), 0.001), corners, Pose2())
    assert found.signed_mm == pytest.approx(0.0, abs=0.15)


def test_a_shape_inside_the_truth_has_a_negative_mean_error() -> None:
    inner, outer = trimesh.creation.box((0.098, 0.058, 0.038)), BOX
    sigma_m = np.full(len(inner.vertices), 0.0004)
    found = mesh_consistency(inner, sigma_m, outer, Pose3())
    assert found.signed_mm == pytest.approx(-1.0, abs=0.05)
    assert found.inside == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
    ring = np.array([[0.049, 0.029], [-0.049, 0.029], [-0.049, -0.029], [0.049, -0.029]])
    planar = outline_consistency(ring, np.full(4, 0.001), ring / 0.049 * 0.050, Pose2())
    assert planar.signed_mm < -0.5
