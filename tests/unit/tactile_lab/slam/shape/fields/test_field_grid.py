"""Tabulated fields: exact where linear, close where smooth, sensible beyond the border."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.posterior import Prediction
from tests.support.shape_examples import contacts_on_sphere


class LinearField:
    """``slope . x + 1``, with a variance that is linear too."""

    def __init__(self, slope: np.ndarray) -> None:
        self._slope = slope

    def predict(self, points_m: np.ndarray, *, gradient: bool = False, variance: bool = False) -> Prediction:
        count = len(points_m) if gradient else 0
        spread = points_m.sum(axis=1) + 5 if variance else np.empty(0)
        return Prediction(points_m @ self._slope + 1, np.tile(self._slope, (count, 1)), spread)


@pytest.mark.parametrize("variance_step", [1, 2, 3])
@pytest.mark.parametrize("dimension", [2, 3])
def test_linear_fields_are_looked_up_exactly(dimension: int, variance_step: int) -> None:
    field = LinearField(np.array([1.0, -2.0, 0.5])[:dimension])
    lower, upper = np.full(dimension, -1.0), np.linspace(0.5, 1.0, dimension)
    grid = FieldGrid.tabulate(field, lower, upper, 0.25, gradient=True, variance=True, variance_step=variance_step)
    queries = np.random.default_rng(0).uniform(lower, upper, (200, dimension))
    queries = np.vstack([queries, lower, upper])
    found, expected = (f.predict(queries, gradient=True, variance=True) for f in (grid, field))
    np.testing.assert_allclose(found.mean_m, expected.mean_m, atol=1e-12)
    np.testing.assert_allclose(found.gradient, expected.gradient, atol=1e-12)
    np.testing.assert_allclose(found.variance_m2, expected.variance_m2, atol=1e-12)


def test_grid_covers_the_asked_range_with_the_asked_spacing() -> None:
    grid = FieldGrid.tabulate(LinearField(np.ones(2)), np.zeros(2), np.array([1.0, 0.55]), 0.1)
    assert grid.values_m.shape == (11, 7)


@pytest.mark.parametrize(("dimension", "spacing_m", "tolerance_m"), [(2, 0.002, 1e-4), (3, 0.004, 4e-4)])
def test_surface_fields_are_looked_up_closely(dimension: int, spacing_m: float, tolerance_m: float) -> None:
    points, normals = contacts_on_sphere(0.04, 30, dimension, seed=0)
    field = Gpis.fit(points, normals)
    grid = FieldGrid.around(field, margin_m=0.02, spacing_m=spacing_m)
    queries = np.random.default_rng(1).uniform(-0.05, 0.05, (300, dimension))
    found, expected = (f.predict(queries, gradient=True, variance=True) for f in (grid, field))
    np.testing.assert_allclose(found.mean_m, expected.mean_m, atol=tolerance_m)
    np.testing.assert_allclose(found.gradient, expected.gradient, atol=0.03)
    np.testing.assert_allclose(np.sqrt(found.variance_m2), np.sqrt(expected.variance_m2), atol=2e-4)


def test_beyond_the_grid_the_distance_to_it_is_added() -> None:
    grid = FieldGrid.tabulate(LinearField(np.array([1.0, 0.0])), np.zeros(2), np.ones(2), 0.5)
    beyond = np.array([[4.0, 0.5], [4.0, 5.0], [0.5, -2.0]])
    np.testing.assert_allclose(grid.predict(beyond).mean_m, [2 + 3, 2 + 5, 1.5 + 2])


def test_asking_for_what_was_not_tabulated_is_an_error() -> None:
    grid = FieldGrid.tabulate(LinearField(np.ones(2)), np.zeros(2), np.ones(2), 0.5)
    with pytest.raises(ShapeError, match="without gradients"):
        grid.predict(np.zeros((1, 2)), gradient=True)
    with pytest.raises(ShapeError, match="without variances"):
        grid.predict(np.zeros((1, 2)), variance=True)


def test_too_large_a_grid_is_refused_before_it_is_made() -> None:
    with pytest.raises(ShapeError, match="too large"):
        FieldGrid.tabulate(LinearField(np.ones(3)), np.zeros(3), np.ones(3), 1e-4)
