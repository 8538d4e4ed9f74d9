"""Algorithm 3.1's filter: weights, estimate, covariance (3.23) and resampling."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.filter.particle_filter import Belief


def test_a_certain_belief_has_no_covariance() -> None:
    estimate = Belief.certain(np.array([0.1, 0.2, 3.1]), 100).estimate()
    assert np.allclose(estimate.pose, [0.1, 0.2, 3.1])
    assert np.allclose(estimate.covariance, 0.0)


def test_weights_are_normalised_and_follow_the_likelihood() -> None:
    belief = Belief.certain(np.zeros(3), 3).weight(np.log([1.0, 2.0, 1.0]) - 1000.0)
    assert belief is not None
    assert np.allclose(belief.weights, [0.25, 0.5, 0.25])
    assert belief.effective_count == pytest.approx(1 / (0.25**2 + 0.5**2 + 0.25**2))


def test_a_likelihood_of_zero_everywhere_gives_no_belief() -> None:
    assert Belief.certain(np.zeros(3), 5).weight(np.full(5, -np.inf)) is None


def test_particles_of_weight_zero_stay_excluded() -> None:
    belief = Belief(np.zeros((2, 3)), np.array([0.0, 1.0])).weight(np.zeros(2))
    assert belief is not None
    assert belief.weights[0] == 0.0


def test_covariance_is_that_of_the_weighted_particles() -> None:
    rng = np.random.default_rng(0)
    rows, weights = rng.normal(size=(50, 3)) * 0.1, rng.random(50)
    belief = Belief(rows, weights / weights.sum())
    expected = np.cov(rows.T, aweights=belief.weights, ddof=0)
    estimate = belief.estimate()
    assert np.allclose(estimate.covariance[:2, :2], expected[:2, :2])
    assert np.allclose(estimate.covariance, expected, atol=1e-4)


def test_angles_are_averaged_across_the_wrap() -> None:
    rows = np.array([[0, 0, np.pi - 0.1], [0, 0, -np.pi + 0.1]])
    estimate = Belief(rows, np.array([0.5, 0.5])).estimate()
    assert abs(estimate.pose[2]) == pytest.approx(np.pi)
    assert estimate.covariance[2, 2] == pytest.approx(0.01)


def test_resampling_keeps_the_share_of_each_particle() -> None:
    count = 1000
    rows = np.column_stack([np.arange(count), np.zeros((count, 2))]).astype(float)
    weights = np.zeros(count)
    weights[10], weights[20] = 0.25, 0.75
    drawn = Belief(rows, weights).resample(np.random.default_rng(0))
    assert np.sum(drawn.rows[:, 0] == 10) == 250
    assert np.sum(drawn.rows[:, 0] == 20) == 750
    assert np.allclose(drawn.weights, 1 / count)


def test_an_effective_belief_is_not_resampled() -> None:
    belief = Belief.certain(np.zeros(3), 10)
    assert belief.resample(np.random.default_rng(0)) is belief


def test_prediction_moves_every_particle_and_keeps_weights() -> None:
    belief = Belief(np.zeros((4, 3)), np.array([0.1, 0.2, 0.3, 0.4]))
    noise = MotionNoise(translation_m=1e-9, rotation_rad=1e-9)
    moved = belief.predict(np.array([0.01, 0.0, 0.1]), noise, np.random.default_rng(0))
    assert np.allclose(moved.rows, [0.01, 0.0, 0.1], atol=1e-6)
    assert np.allclose(moved.weights, belief.weights)
