"""Poses as rows of numbers, on the table and free in space: geometry and derivatives against gtsam and differences."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Array
from drivers.core.rotations import exponential, logarithm, right_jacobian
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR, PoseVectors
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost

BOTH = pytest.mark.parametrize("space", [PLANAR, SPATIAL], ids=["planar", "spatial"])
angles = st.floats(-3.0, 3.0)


def some_rows(space: PoseVectors, count: int, seed: int = 0) -> Array:
    rows = np.random.default_rng(seed).normal(size=(count, space.size))
    return np.asarray(rows * np.where(np.arange(space.size) < space.translations, 0.05, 0.6))


@settings(max_examples=40, derandomize=True, deadline=None)
@given(st.tuples(angles, angles, angles))
def test_rotation_vectors_agree_with_gtsam(vector: tuple[float, float, float]) -> None:
    rotation = Rot3.Expmap(np.array(vector)).matrix()
    np.testing.assert_allclose(exponential(np.array(vector)), rotation, atol=1e-12)
    np.testing.assert_allclose(exponential(logarithm(rotation)), rotation, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-9, np.pi])
def test_the_logarithm_holds_from_no_turn_to_half_a_turn(angle: float) -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    np.testing.assert_allclose(np.linalg.norm(logarithm(exponential(angle * axis))), angle, atol=1e-9)


@pytest.mark.parametrize("scale", [0.0, 1e-6, 0.5, 3.0])
def test_the_right_jacobian_is_the_derivative_of_the_exponential(scale: float) -> None:
    vector = scale * np.array([0.6, 0.0, 0.8])
    for axis in np.eye(3):
        change = logarithm(exponential(vector).T @ exponential(vector + 1e-6 * axis)) / 1e-6
        np.testing.assert_allclose(right_jacobian(vector) @ axis, change, atol=1e-5)


@BOTH
def test_composing_is_composing_poses(space: PoseVectors) -> None:
    one, other = some_rows(space, 2)
    expected = space.pose(one, 0.0).compose(space.pose(other, 0.0))
    assert expected.equals(space.pose(space.compose(one, other), 0.0), 1e-9)
    assert Pose3().equals(space.pose(space.compose(space.inverse(one), one), 0.0), 1e-9)
    np.testing.assert_allclose(space.motion(space.pose(one, 0.0)), one, atol=1e-9)


@BOTH
def test_deviations_vanish_only_for_equal_poses(space: PoseVectors) -> None:
    one, other = some_rows(space, 2)
    np.testing.assert_allclose(space.deviation(one, one), 0.0, atol=1e-12)
    assert np.linalg.norm(space.deviation(one, other)) > 0.1


@BOTH
def test_contacts_in_the_object_frame_follow_the_chain_rule(space: PoseVectors) -> None:
    rng = np.random.default_rng(1)
    rows, points, normals = some_rows(space, 5), rng.normal(size=(5, 3)) * 0.1, rng.normal(size=(5, 3))
    by_points, by_normals = rng.normal(size=(5, 3)), rng.normal(size=(5, 3))

    def value(at: Array) -> Array:
        placed, turned = space.to_object(at, points, normals)
        return np.asarray(np.sum(placed * by_points + turned * by_normals, axis=1))

    found = space.by_row(rows, *space.to_object(rows, points, normals), by_points, by_normals)
    for number in range(space.size):
        step = np.zeros(space.size)
        step[number] = 1e-6
        slope = (value(rows + step) - value(rows - step)) / 2e-6
        np.testing.assert_allclose(found[:, number], slope, atol=1e-7)


@BOTH
def test_the_motion_cost_has_the_gradient_of_its_value(space: PoseVectors) -> None:
    rows, motions = some_rows(space, 4), 0.3 * some_rows(space, 4, seed=2)
    cost = MotionCost(motions, MotionNoise(translation_m=0.05, rotation_rad=0.5), space)
    value, gradient = cost.value_and_gradient(rows)
    assert value == pytest.approx(cost.value(rows))
    for index in np.ndindex(*rows.shape):
        step = np.zeros_like(rows)
        step[index] = 1e-6
        slope = (cost.value(rows + step) - cost.value(rows - step)) / 2e-6
        assert gradient[index] == pytest.approx(slope, rel=1e-4, abs=1e-4)


@BOTH
def test_small_steps_stay_in_the_usual_range(space: PoseVectors) -> None:
    row = np.zeros(space.size)
    row[-1] = 3.1
    moved = space.move(row, np.eye(space.size)[-1] * 0.1)
    assert moved[-1] == pytest.approx(3.2 - 2 * np.pi)


def test_a_row_turns_points_as_its_pose_does() -> None:
    row = np.array([0.1, -0.2, 0.3, 0.4, 0.5, -0.6])
    pose = Pose3(Rot3.Expmap(row[3:]), row[:3])
    placed, _ = SPATIAL.to_object(row, np.array([[0.5, 0.5, 0.5]]), np.zeros((1, 3)))
    np.testing.assert_allclose(placed[0], pose.transformTo(np.array([0.5, 0.5, 0.5])), atol=1e-12)
