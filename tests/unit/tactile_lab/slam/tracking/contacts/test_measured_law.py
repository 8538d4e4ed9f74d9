import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm
from scipy.stats import t as student_t

from tactile_lab.slam.tracking.contacts.measured_law import as_normal, heavy_tailed_cost, heavy_tailed_weight, spread

ratios = st.floats(-50.0, 50.0)


@given(ratios, st.integers(1, 3))
def test_the_weight_is_the_costs_derivative(ratio: float, dimensions: int):
    squared, step = np.array([ratio**2]), 1e-5 * (1 + ratio**2)
    of = np.array([dimensions])
    slope = (heavy_tailed_cost(squared + step, of) - heavy_tailed_cost(squared, of)) / step
    assert heavy_tailed_weight(squared, of) / 2 == pytest.approx(slope, rel=1e-4)


@given(ratios)
def test_the_cost_is_that_of_students_t_with_the_stated_standard_deviation(ratio: float):
    scale = np.sqrt(3 / 5)
    assert student_t.std(5, scale=scale) == pytest.approx(1.0)
    density = student_t.logpdf(ratio, 5, scale=scale) - student_t.logpdf(0.0, 5, scale=scale)
    assert -heavy_tailed_cost(np.array([ratio**2]), np.array([1]))[0] == pytest.approx(density, abs=1e-9)


@given(ratios)
def test_errors_become_those_that_a_normal_distribution_has_as_often(ratio: float):
    errors = as_normal(np.array([ratio, -ratio, abs(ratio) + 0.1]))
    assert errors[0] == pytest.approx(-errors[1])
    assert abs(errors[0]) < errors[2]
    assert norm.sf(abs(errors[0])) == pytest.approx(student_t.sf(abs(ratio), 5, scale=np.sqrt(3 / 5)), rel=1e-6)


def test_one_two_and_three_sigma_hold_as_much_as_of_a_normal_distribution():
    assert as_normal(np.array([0.8607, 2.0514, 4.2643])) == pytest.approx([1.0, 2.0, 3.0], abs=2e-3)


@given(st.floats(0.2, 5.0), st.integers(0, 2**32 - 1))
def test_the_spread_is_the_standard_deviation_and_a_far_one_hardly_widens_it(sigma: float, seed: int):
    errors = sigma * np.sqrt(3 / 5) * np.random.default_rng(seed).standard_t(5, 400)
    assert spread(errors) == pytest.approx(sigma, rel=0.3)
    assert spread(np.append(errors, 100 * sigma)) == pytest.approx(spread(errors), rel=0.03)


@given(st.integers(1, 60), st.floats(1e-150, 1e150))
def test_any_errors_have_a_spread(off: int, size: float):
    errors = np.zeros(60)
    errors[:off] = size
    assert spread(errors) == 0.0 if off <= 10 else spread(errors) <= 1.3 * size
