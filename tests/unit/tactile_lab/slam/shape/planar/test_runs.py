"""Moments of straight runs, turned by quarter turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tactile_lab.slam.shape.planar.runs import (
    chi_square_at,
    direction_variance,
    fit_direction,
    most_gained,
    run_costs,
    turn_back,
)


@given(arrays(float, 6, elements=st.floats(-3, 3)), st.integers(-7, 7), st.floats(-3, 3))
def test_a_face_turned_back_is_as_good_in_the_turned_direction(moments: np.ndarray, turns: int, angle: float) -> None:
    turned = turn_back(moments, turns)
    assert chi_square_at(angle - turns * np.pi / 2, turned) == pytest.approx(chi_square_at(angle, moments), abs=1e-9)


def test_the_variance_is_the_curvatures() -> None:
    moments, step = np.array([0.2, 0.1, 0.5, 30.0, 4.0, 60.0]), 1e-3
    before, here, after = (chi_square_at(0.13 + offset, moments) for offset in (-step, 0.0, step))
    assert direction_variance(0.13, moments) == pytest.approx(2 * step**2 / (before - 2 * here + after), rel=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_a_run_costs_what_its_best_line_misses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, angles = rng.normal(size=(7, 2)), rng.normal(size=7) * 0.3
    normals, weights, stiffness = np.column_stack([np.cos(angles), np.sin(angles)]), rng.uniform(1, 4, (2, 7)), 30.0
    costs, directions, offsets = run_costs(points, normals, weights[0], stiffness * weights[1])
    turns = np.linspace(-np.pi, np.pi, 20001)
    for i, j in zip(*np.triu_indices(7), strict=True):
        run = slice(i, j + 1)
        along = np.column_stack([np.cos(turns), np.sin(turns)])
        middle = np.average(points[run], axis=0, weights=weights[0, run])
        misses = weights[0, run] @ ((points[run] - middle) @ along.T) ** 2
        misses = misses + 2 * stiffness * (weights[1, run] @ (1 - normals[run] @ along.T))
        assert costs[i, j] == pytest.approx(misses.min(), abs=1e-3)
        u = np.array([np.cos(directions[i, j]), np.sin(directions[i, j])])
        assert offsets[i, j] == pytest.approx(u @ middle)


def test_the_pair_that_gains_most_is_the_one_of_equal_directions() -> None:
    angles = np.array([0.30, 1.10, 0.31 + np.pi / 2])
    pulls = 400.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    moments = np.column_stack([np.full((3, 3), [20.0, 3.0, 25.0]), pulls, np.full(3, 800.0)])
    best = fit_direction(*moments[:, :5].T)
    gain, *pair = most_gained(moments, best, np.ones(3), 1.0)
    assert pair == [0, 2]
    assert gain > 0
    assert most_gained(moments[:1], best[:1], np.ones(1), 1.0) == (0.0, 0, 0)
