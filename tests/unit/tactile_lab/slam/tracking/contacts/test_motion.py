"""Planar motion: the composition of eq. 3.8 and the noise of eq. 3.7."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2, Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from tactile_lab.slam.tracking.contacts.contact_map import Moved
from tactile_lab.slam.tracking.contacts.motion import (
    MotionNoise,
    compose,
    deviation,
    inverse,
    planar_motion,
    pose_vector,
    sample_motion,
    spatial_pose,
    vector_pose,
)
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost, pushed_nats

rows = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0)).map(np.array)


@given(rows, rows)
@settings(max_examples=30, derandomize=True)
def test_composition_agrees_with_gtsam(motion: np.ndarray, row: np.ndarray) -> None:
    expected = vector_pose(motion).compose(vector_pose(row))
    assert vector_pose(compose(motion, row)).equals(expected, 1e-9)


@given(rows)
@settings(max_examples=20, derandomize=True)
def test_inverse_undoes_a_pose(row: np.ndarray) -> None:
    assert np.allclose(compose(inverse(row), row), 0.0, atol=1e-12)


def test_many_poses_move_like_each_of_them() -> None:
    motion = np.array([0.01, -0.02, 0.4])
    many = np.random.default_rng(0).normal(size=(5, 3))
    assert np.allclose(compose(motion, many), [compose(motion, row) for row in many])


def test_hand_motion_is_projected_onto_the_table() -> None:
    tilted = Pose3(Rot3.Ypr(0.5, 0.02, -0.01), np.array([0.01, 0.02, 0.3]))
    assert np.allclose(planar_motion(tilted), [0.01, 0.02, 0.5], atol=1e-3)


def test_angles_are_compared_across_the_wrap() -> None:
    gap = deviation(np.array([0.0, 0.0, np.pi - 0.01]), np.array([0.0, 0.0, -np.pi + 0.01]))
    assert gap[2] == pytest.approx(-0.02)


def test_samples_spread_as_configured_about_the_predicted_pose() -> None:
    noise = MotionNoise(translation_m=0.01, rotation_rad=0.1)
    start = np.tile([0.1, 0.0, 0.2], (20_000, 1))
    motion = np.array([0.0, 0.05, 0.5])
    drawn = sample_motion(start, motion, noise, np.random.default_rng(1))
    gaps = deviation(drawn, compose(motion, start[0]))
    assert np.allclose(gaps.mean(axis=0), 0.0, atol=2e-3)
    assert np.allclose(gaps.std(axis=0), noise.sigmas, rtol=0.03)


def test_default_noise_is_the_thesis_s_hundred_percent() -> None:
    assert np.allclose(MotionNoise().sigmas, [0.010, 0.010, np.deg2rad(20.0)])


def test_noise_grows_with_the_root_of_the_steps() -> None:
    assert np.allclose(MotionNoise().accumulate(4).sigmas, 2 * MotionNoise().sigmas)


def test_noise_must_be_positive() -> None:
    with pytest.raises(ValidationError):
        MotionNoise(translation_m=0.0)


def test_a_row_in_space_stands_at_the_given_height() -> None:
    pose = spatial_pose(pose_vector(Pose2(0.1, 0.2, 0.3)), 0.022)
    assert np.allclose(pose.translation(), [0.1, 0.2, 0.022])
    assert pose.rotation().yaw() == pytest.approx(0.3)


def test_an_object_that_was_left_lying_is_expected_where_it_was() -> None:
    noise = MotionNoise(translation_m=0.01, rotation_rad=0.1, unheld=0.2)
    still, carried = np.zeros(3), np.array([0.0, 0.05, 0.5])
    assert np.allclose(noise.after(still).sigmas, 0.2 * noise.sigmas)
    assert noise.after(np.array([still, carried])) == noise  # of several motions one moved it
    assert noise.after(still).accumulate(4).translation_m == pytest.approx(0.004)
    slip = np.array([0.004, 0.0, 0.0])
    costs = [
        MotionCost(np.array([still, motion]), noise, PLANAR).value(np.array([still, compose(motion, still) + slip]))
        for motion in (still, carried)
    ]
    assert costs == pytest.approx([0.5 * 2.0**2, 0.5 * 0.4**2])


def turned(unheld: float, turn_rad: float, how: Moved) -> float:
    """The cost of a turn of an object that the hand left where it was, with the price of how it came about."""
    noise = MotionNoise(translation_m=0.01, rotation_rad=0.2, unheld=unheld)
    rows = np.array([np.zeros(3), [0.0, 0.0, turn_rad]])
    slips = MotionCost(np.zeros((2, 3)), noise, PLANAR, (Moved.AS_MEANT, how)).value(rows)
    return slips + (pushed_nats(noise, PLANAR) if how is Moved.PUSHED else 0.0)


def test_a_hand_that_turns_what_it_should_leave_is_rare_and_not_impossible() -> None:
    """A cube that the closing fingers turned by a sixth of a right angle was lost for the rest of a session."""
    assert turned(0.15, 0.25, Moved.PUSHED) == pytest.approx(np.log(100 * 4**3) + 0.5 * (0.25 / 0.12) ** 2)
    assert turned(0.15, 0.25, Moved.PUSHED) < turned(0.15, 0.25, Moved.AS_MEANT) - 50
    assert turned(0.15, 0.05, Moved.AS_MEANT) < turned(0.15, 0.05, Moved.PUSHED) - 5
    assert turned(0.15, 0.8, Moved.PUSHED) > 60  # a hand does not turn it by half a right angle


def test_where_objects_slip_anyway_nothing_is_gained_by_a_push() -> None:
    for unheld in (0.7, 1.0):
        assert turned(unheld, 0.25, Moved.PUSHED) > turned(unheld, 0.25, Moved.AS_MEANT) + 4


def test_a_motion_that_the_object_did_not_follow_says_next_to_nothing() -> None:
    assert turned(0.15, 3.0, Moved.FREELY) < 1e-3


@pytest.mark.parametrize("size", [0.0005, 0.005])
def test_slips_of_objects_left_and_pushed_have_the_stated_derivatives(size: float) -> None:
    rng = np.random.default_rng(3)
    motions = np.zeros((6, 3))
    motions[2] = [0.01, 0.02, 0.1]
    moved = [Moved.AS_MEANT] * 4 + [Moved.PUSHED, Moved.FREELY]
    cost = MotionCost(motions, MotionNoise(unheld=0.15), PLANAR, moved)
    rows = np.cumsum(rng.normal(size=(6, 3)) * [size, size, 20 * size], axis=0)
    gradient = cost.value_and_gradient(rows)[1]
    numeric = np.zeros_like(rows)
    for each in np.ndindex(rows.shape):
        step = np.zeros_like(rows)
        step[each] = 1e-7
        numeric[each] = (cost.value(rows + step) - cost.value(rows - step)) / 2e-7
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5 * np.abs(numeric).max())
    assert np.linalg.eigvalsh(cost.information(rows)).min() > 0


def test_a_push_that_is_believed_says_little_about_the_usual_slips() -> None:
    noise = MotionNoise(translation_m=0.01, rotation_rad=0.2, unheld=0.15)
    rows, moved = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.25]]), (Moved.AS_MEANT, Moved.PUSHED)
    slips = MotionCost(np.zeros((2, 3)), noise, PLANAR, moved).slips_in_sigma(rows)
    assert slips[0, 1] == pytest.approx(0.25 / 0.12)
