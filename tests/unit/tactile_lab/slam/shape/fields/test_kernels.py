"""Covariance functions against finite differences, known values and positive definiteness."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tactile_lab.slam.shape.fields.kernels import (
    Kernel,
    Matern52,
    SquaredExponential,
    ThinPlate,
    covariance,
    cross_covariance,
    log_parameter_traces,
)

KERNELS: list[Kernel] = [SquaredExponential(4e-4, 0.05), Matern52(4e-4, 0.08), ThinPlate(0.4, 0.02)]
EVERY_KERNEL = pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: type(kernel).__name__)
BOTH_DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])


def scattered(count: int, dimension: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.05, 0.05, (count, dimension))


def value_covariance(kernel: Kernel, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return kernel.profile(np.sum((first - second) ** 2, axis=-1)).value


def test_squared_exponential_is_equation_2_15_without_the_factor_two() -> None:
    kernel = SquaredExponential(amplitude=3.0, length=2.0)
    assert kernel.profile(np.array([4.0])).value == pytest.approx(3.0 * np.exp(-1.0))


def test_matern_has_the_closed_form_of_smoothness_five_halves() -> None:
    scaled = np.sqrt(5) * 1.5 / 2.0
    expected = 3.0 * (1 + scaled + scaled**2 / 3) * np.exp(-scaled)
    assert Matern52(amplitude=3.0, length=2.0).profile(np.array([1.5**2])).value == pytest.approx(expected)


def test_thin_plate_with_the_thesis_amplitude_is_equation_2_17() -> None:
    radius, distance = 0.3, 0.12
    expected = (2 * distance**3 - 3 * radius * distance**2 + radius**3) / 12
    found = ThinPlate(radius, radius**3 / 12).profile(np.array([distance**2])).value
    assert found == pytest.approx(expected)


def test_thin_plate_is_finite_at_zero_and_independent_beyond_its_radius() -> None:
    phi = ThinPlate(0.1, 1.0).profile(np.array([0.0, 0.1**2, 0.2**2]))
    assert np.isfinite(phi.second).all()
    np.testing.assert_allclose(phi.value, [1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(phi.first[1:], 0.0, atol=1e-15)


@EVERY_KERNEL
def test_profile_derivatives_agree_with_finite_differences(kernel: Kernel) -> None:
    squared = np.array([0.01, 0.03, 0.08]) ** 2
    step = 1e-4 * squared
    before, after, here = kernel.profile(squared - step), kernel.profile(squared + step), kernel.profile(squared)
    np.testing.assert_allclose((after.value - before.value) / (2 * step), here.first, rtol=1e-6)
    np.testing.assert_allclose((after.first - before.first) / (2 * step), here.second, rtol=1e-6)


@EVERY_KERNEL
@BOTH_DIMENSIONS
def test_gradient_blocks_agree_with_finite_differences_of_the_values(kernel: Kernel, dimension: int) -> None:
    points, count, step = scattered(5, dimension), 5, 1e-5
    matrix = covariance(kernel, points, count)
    for i, shift in enumerate(step * np.eye(dimension)):
        rows = slice(count + i * count, count + (i + 1) * count)
        ahead = value_covariance(kernel, points[:, None] + shift, points[None])
        behind = value_covariance(kernel, points[:, None] - shift, points[None])
        slope = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(matrix[rows, :count], slope, atol=1e-6 * np.abs(slope).max() + 1e-12)


@EVERY_KERNEL
@BOTH_DIMENSIONS
def test_gradient_gradient_block_agrees_with_mixed_finite_differences(kernel: Kernel, dimension: int) -> None:
    points, step = scattered(2, dimension, seed=3), 1e-4
    matrix = covariance(kernel, points, 2)
    x, z = points
    for i, j in np.ndindex(dimension, dimension):
        mixed = sum(
            s * t * value_covariance(kernel, x + s * step * np.eye(dimension)[i], z + t * step * np.eye(dimension)[j])
            for s in (-1, 1)
            for t in (-1, 1)
        ) / (4 * step**2)
        assert matrix[2 + 2 * i, 2 + 2 * j + 1] == pytest.approx(mixed, rel=1e-3, abs=1e-5 * np.abs(matrix).max())


@EVERY_KERNEL
@BOTH_DIMENSIONS
def test_covariance_is_symmetric_and_positive_semidefinite(kernel: Kernel, dimension: int) -> None:
    matrix = covariance(kernel, scattered(15, dimension), 15)
    np.testing.assert_array_equal(matrix, matrix.T)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9 * np.linalg.eigvalsh(matrix).max()


@EVERY_KERNEL
@BOTH_DIMENSIONS
def test_cross_covariance_at_the_data_is_the_value_rows_of_the_covariance(kernel: Kernel, dimension: int) -> None:
    points = scattered(7, dimension)
    np.testing.assert_allclose(cross_covariance(kernel, points, points, 4), covariance(kernel, points, 4)[:7])


def test_without_gradients_only_the_values_remain() -> None:
    points = scattered(6, 2)
    assert covariance(KERNELS[0], points, 0).shape == (6, 6)
    assert cross_covariance(KERNELS[0], points[:2], points, 0).shape == (2, 6)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    kernel=st.sampled_from(KERNELS),
    dimension=st.sampled_from([2, 3]),
    gradient_count=st.integers(0, 6),
    seed=st.integers(0, 1000),
)
def test_parameter_traces_agree_with_central_differences(
    kernel: Kernel, dimension: int, gradient_count: int, seed: int
) -> None:
    points = scattered(6, dimension, seed)
    rows = 6 + gradient_count * dimension
    weights = np.random.default_rng(seed).normal(size=(rows, rows))
    weights += weights.T
    found = log_parameter_traces(kernel, points, gradient_count, weights)
    for index, shift in enumerate(1e-5 * np.eye(len(kernel.log_parameters))):
        change = covariance(kernel.with_log_parameters(kernel.log_parameters + shift), points, gradient_count)
        change -= covariance(kernel.with_log_parameters(kernel.log_parameters - shift), points, gradient_count)
        scale = np.abs(weights * change).sum() / 2e-5
        assert found[index] == pytest.approx(np.vdot(weights, change) / 2e-5, abs=1e-6 * scale)
