"""Entropies, divergences and spreads of particles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tactile_lab.slam.exploration.information.distributions import (
    kl_divergence,
    mutual_information,
    renyi_entropy,
    shannon_entropy,
)
from tactile_lab.slam.exploration.information.particles import (
    determinant,
    gaussian_entropy,
    mixture_entropy,
    modes,
    weighted_covariance,
    weighted_mean,
)

WEIGHTS = st.lists(st.floats(0.0, 1.0), min_size=2, max_size=20).filter(lambda values: sum(values) > 0.1)


def test_entropy_is_that_of_a_fair_and_of_a_decided_choice() -> None:
    assert shannon_entropy(np.full(8, 1 / 8)) == pytest.approx(np.log(8))
    assert shannon_entropy(np.array([0.0, 3.0, 0.0])) == 0.0
    assert shannon_entropy(np.array([0.5, 0.25, 0.25])) == pytest.approx(1.5 * np.log(2))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(WEIGHTS, st.floats(0.0, 6.0))
def test_renyi_entropy_falls_with_its_order_and_meets_shannon_at_one(values: list[float], order: float) -> None:
    weights = np.array(values)
    assert renyi_entropy(weights, order) >= renyi_entropy(weights, order + 0.5) - 1e-9
    assert renyi_entropy(weights, 1.0) == shannon_entropy(weights)
    assert renyi_entropy(weights, 1.0001) == pytest.approx(shannon_entropy(weights), abs=2e-3)


def test_renyi_entropy_is_the_standard_one_and_not_the_printed_one() -> None:
    weights = np.array([0.5, 0.25, 0.25])
    assert renyi_entropy(weights, 2.0) == pytest.approx(-np.log(0.375))
    assert renyi_entropy(weights, np.inf) == pytest.approx(np.log(2))
    printed = np.sum(weights * np.log(weights)) / (1 - 2.0)
    assert renyi_entropy(weights, 2.0) != pytest.approx(printed)
    with pytest.raises(ValueError, match="not negative"):
        renyi_entropy(weights, -1.0)


def test_a_measurement_that_singles_out_one_particle_tells_all_there_was_to_know() -> None:
    before, after = np.full(4, 0.25), np.array([0.0, 1.0, 0.0, 0.0])
    assert mutual_information(before, after) == pytest.approx(np.log(4))
    assert kl_divergence(after, before) == pytest.approx(np.log(4))
    assert kl_divergence(before, after) == np.inf


@settings(max_examples=40, deadline=None, derandomize=True)
@given(WEIGHTS)
def test_divergence_is_zero_only_between_equals(values: list[float]) -> None:
    weights = np.array(values) + 0.01
    assert kl_divergence(weights, 3.0 * weights) == pytest.approx(0.0, abs=1e-12)
    other = weights.copy()
    other[0] += 1.0
    assert kl_divergence(weights, other) > 0


@pytest.mark.parametrize("weights", [[], [0.0, 0.0], [0.5, -0.1], [np.nan, 1.0]])
def test_what_is_no_distribution_is_refused(weights: list[float]) -> None:
    with pytest.raises(ValueError, match="weights of a distribution"):
        shannon_entropy(np.array(weights))


def test_weighted_covariance_is_unbiased_for_equal_weights() -> None:
    rows = np.random.default_rng(0).normal(size=(50, 3)) * [0.01, 0.02, 0.1]
    assert weighted_covariance(rows, np.full(50, 0.02)) == pytest.approx(np.cov(rows.T))
    assert np.all(weighted_covariance(rows, np.eye(50)[3]) == 0.0)
    assert determinant(np.zeros((3, 3))) == 0.0


def test_headings_are_averaged_across_the_half_turn() -> None:
    rows = np.array([[0.0, 0.0, np.pi - 0.1], [0.0, 0.0, -np.pi + 0.1]])
    assert abs(weighted_mean(rows, np.array([0.5, 0.5]))[2]) == pytest.approx(np.pi)
    assert weighted_covariance(rows, np.array([0.5, 0.5]))[2, 2] == pytest.approx(0.02)


def two_heaps(apart_m: float) -> np.ndarray:
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(400, 3)) * [0.001, 0.001, 0.02]
    rows[:100, 0] += apart_m
    return rows


def test_two_heaps_are_two_modes_and_one_heap_is_one() -> None:
    weights = np.full(400, 1 / 400)
    found = modes(two_heaps(0.08), weights)
    assert [mode.weight for mode in found] == pytest.approx([0.75, 0.25])
    assert found[1].mean[0] == pytest.approx(0.08, abs=5e-4)
    assert len(modes(two_heaps(0.0), weights)) == 1


def test_the_mixture_has_the_spread_of_all_but_not_its_entropy() -> None:
    rows, weights = two_heaps(0.08), np.full(400, 1 / 400)
    found = modes(rows, weights)
    whole = weighted_covariance(rows, weights)
    assert mixture_entropy(found) < gaussian_entropy(whole) - 1.0
    alone = modes(two_heaps(0.0), weights)
    assert mixture_entropy(alone) == pytest.approx(gaussian_entropy(weighted_covariance(two_heaps(0.0), weights)))
