"""Shape errors and alignments of pairs whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from gtsam import Pose2, Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from drivers.core.poses import spatial, transform_points
from tactile_lab.slam.shape.metrics.alignment import align_contours, align_meshes
from tactile_lab.slam.shape.metrics.metrics import contour_errors, mesh_errors
from tactile_lab.slam.shape.metrics.overlap import mesh_overlap, polygon_overlap
from tactile_lab.slam.shape.surfaces.sampling import (
    distances_to_mesh,
    distances_to_polygon,
    sample_mesh,
    sample_polygon,
)
from tests.support.shape_examples import ellipse, l_block, rectangle

SQUARE = np.array([[0.0, 0.0], [0.04, 0.0], [0.04, 0.04], [0.0, 0.04]])


def shifted(outline: Array, x_m: float, y_m: float) -> Array:
    return outline + np.array([x_m, y_m])


def moved(outline: Array, pose: Pose2) -> Array:
    return transform_points(spatial(pose), np.pad(outline, ((0, 0), (0, 1))))[:, :2]


def test_equal_outlines_have_no_error() -> None:
    errors = contour_errors(l_block(), l_block()[::-1])
    assert errors.hausdorff_m == pytest.approx(0, abs=1e-12)
    assert errors.chamfer_m == pytest.approx(0, abs=1e-12)
    assert errors.fscore_1mm == 1.0
    assert errors.iou == pytest.approx(1.0)


def test_hausdorff_of_nested_squares_is_the_distance_of_their_corners() -> None:
    inner = 0.01 + 0.5 * SQUARE
    errors = contour_errors(inner, SQUARE)
    assert errors.estimated_to_truth_m == pytest.approx(0.01)
    assert errors.truth_to_estimated_m == pytest.approx(0.01 * np.sqrt(2))
    assert errors.hausdorff_m == errors.truth_to_estimated_m
    assert errors.iou == pytest.approx(0.25)
    assert errors.fscore_1mm == 0.0


def test_spike_is_seen_from_the_estimate_only() -> None:
    spiked = np.vstack([SQUARE, [[0.0, 0.0201], [-0.03, 0.02], [0.0, 0.0199]]])
    errors = contour_errors(spiked, SQUARE)
    assert errors.hausdorff_m == errors.estimated_to_truth_m == pytest.approx(0.03)
    assert errors.truth_to_estimated_m < 1e-3
    assert 0.5 < errors.fscore_1mm < 1


def test_mean_distances_of_concentric_circles_are_their_gap() -> None:
    errors = contour_errors(ellipse(0.05, 0.05), ellipse(0.047, 0.047))
    assert errors.mean_distance_m == pytest.approx(0.003, rel=1e-3)
    assert errors.chamfer_m == pytest.approx(0.006, rel=1e-3)
    assert errors.iou == pytest.approx((47 / 50) ** 2)


@pytest.mark.parametrize(
    ("first", "second", "overlap"),
    [
        (SQUARE, SQUARE + 0.02, 1 / 7),
        (SQUARE, shifted(SQUARE, 0.02, 0.0), 1 / 3),
        (SQUARE, shifted(SQUARE[::-1], 0.0, 0.01), 0.6),
        (SQUARE, SQUARE + 1.0, 0.0),
        (SQUARE, SQUARE * [0.0, 1.0], 0.0),
        (shifted(l_block(), 0.04, 0.032), np.array([[0, 0], [0.1, 0], [0.1, 0.04], [0, 0.04]]), 4 / 5.6),
    ],
)
def test_polygon_overlap_of_known_pairs(first: Array, second: Array, overlap: float) -> None:
    assert polygon_overlap(first, second) == pytest.approx(overlap, abs=1e-12)


def test_distances_to_a_polygon_are_exact() -> None:
    points = np.array([[0.02, 0.05], [0.05, 0.05], [0.02, 0.03], [0.04, 0.02]])
    np.testing.assert_allclose(distances_to_polygon(points, SQUARE), [0.01, 0.01 * np.sqrt(2), 0.01, 0], atol=1e-15)


def test_samples_of_a_polygon_are_even_and_on_it() -> None:
    samples = sample_polygon(SQUARE, 0.0005)
    assert len(samples) == 320
    np.testing.assert_allclose(np.linalg.norm(np.diff(samples, axis=0), axis=1), 0.0005)
    np.testing.assert_allclose(distances_to_polygon(samples, SQUARE), 0, atol=1e-15)


def test_samples_of_a_mesh_follow_area_and_repeat() -> None:
    box = trimesh.creation.box((0.12, 0.06, 0.03))
    samples = sample_mesh(box, 20_000)
    np.testing.assert_array_equal(samples, sample_mesh(box, 20_000))
    np.testing.assert_allclose(distances_to_mesh(samples, box), 0, atol=1e-12)
    on_top = np.mean(np.isclose(samples[:, 2], 0.015))
    assert on_top == pytest.approx(0.12 * 0.06 / box.area, rel=0.01)


def test_mesh_errors_of_nested_boxes_are_exact_at_the_corners() -> None:
    inner, outer = trimesh.creation.box((0.04, 0.04, 0.04)), trimesh.creation.box((0.06, 0.06, 0.06))
    errors = mesh_errors(inner, outer)
    assert errors.estimated_to_truth_m == pytest.approx(0.01)
    assert errors.truth_to_estimated_m == pytest.approx(0.01 * np.sqrt(3))
    assert errors.iou == pytest.approx((4 / 6) ** 3, abs=0.003)
    assert errors == mesh_errors(inner, outer)


def test_equal_meshes_have_no_error() -> None:
    sphere = trimesh.creation.icosphere(3, 0.04)
    errors = mesh_errors(sphere, sphere)
    assert errors.hausdorff_m == pytest.approx(0, abs=1e-9)
    assert (errors.fscore_1mm, errors.iou) == (1.0, 1.0)


def test_shifted_boxes_overlap_by_their_shift() -> None:
    box = trimesh.creation.box((0.06, 0.06, 0.06))
    assert mesh_overlap(box, box.copy().apply_translation([0.01, 0, 0])) == pytest.approx(5 / 7, abs=0.003)


@settings(max_examples=8, deadline=None, derandomize=True)
@given(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-np.pi, np.pi))
def test_planar_alignment_undoes_any_motion(x_m: float, y_m: float, angle_rad: float) -> None:
    motion = Pose2(x_m, y_m, angle_rad)
    found = align_contours(moved(l_block(), motion), l_block())
    errors = contour_errors(moved(l_block(), motion), l_block(), found)
    assert errors.hausdorff_m < 1e-4
    assert (found * motion).equals(Pose2(), 1e-3)


def test_planar_alignment_slides_a_rectangle_into_place() -> None:
    off = shifted(rectangle(), 0.004, 0.0)
    assert contour_errors(off, rectangle(), align_contours(off, rectangle())).hausdorff_m < 1e-4


def test_upright_alignment_of_meshes_keeps_the_vertical() -> None:
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.06, 0], [0, 0, 0.05], [0.1, 0, 0.05], [0, 0.06, 0.05]])
    wedge = trimesh.convex.convex_hull(corners)
    motion = Pose3(Rot3.Yaw(2.5), np.array([0.03, -0.02, 0.01]))
    turned = wedge.copy().apply_transform(motion.matrix())
    found = align_meshes(turned, wedge, upright=True)
    np.testing.assert_allclose(found.rotation().matrix()[2], [0, 0, 1], atol=1e-12)
    assert (found * motion).equals(Pose3(), 2e-3)


def test_free_alignment_of_meshes_undoes_a_tilt() -> None:
    box = trimesh.creation.box((0.12, 0.06, 0.04))
    motion = Pose3(Rot3.RzRyRx(2.0, -0.7, 1.1), np.array([0.03, -0.02, 0.01]))
    tilted = box.copy().apply_transform(motion.matrix())
    found = align_meshes(tilted, box, upright=False)
    assert mesh_errors(tilted, box, found).hausdorff_m < 2e-4


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        (SQUARE[:2], "estimated outline has shape"),
        (np.zeros((5, 3)), "estimated outline has shape"),
        (np.array([[0, 0], [1, 0], [np.nan, 1]]), "not numbers"),
    ],
)
def test_unusable_outlines_are_refused(outline: Array, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        contour_errors(outline, SQUARE)


def test_empty_mesh_is_refused() -> None:
    with pytest.raises(ShapeError, match="no faces"):
        mesh_errors(trimesh.Trimesh(), trimesh.creation.box((1, 1, 1)))
