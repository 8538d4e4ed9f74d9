"""Observability of relative poses (eq. 3.10 to 3.18)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drivers.core.observability import jacobian, observability, planar_observability

PARALLEL_SIDES = (
    np.array([[-0.03, 0.02], [0.03, 0.02], [-0.03, -0.02], [0.03, -0.02]]),
    np.array([[0, 1], [0, 1], [0, -1], [0, -1]], dtype=float),
)
ALL_SIDES = (
    np.array([[-0.03, 0.02], [0.03, 0.02], [0.0, -0.02], [0.05, 0.0]]),
    np.array([[0, 1], [0, 1], [0, -1], [1, 0]], dtype=float),
)


def test_sliding_along_parallel_sides_is_not_observable() -> None:
    seen = observability(*PARALLEL_SIDES)
    assert seen.smallest == pytest.approx(0.0, abs=1e-12)
    assert np.allclose(np.abs(seen.weakest_direction), [0, 1, 0], atol=1e-6)


def test_a_third_direction_makes_it_observable() -> None:
    assert observability(*ALL_SIDES).smallest > 0.15


def test_contacts_on_a_circle_do_not_tell_its_rotation() -> None:
    angles = np.linspace(0, 2 * np.pi, 7)[:-1]
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    seen = observability(0.03 * circle + 0.2, circle)
    assert seen.smallest == pytest.approx(0.0, abs=1e-12)
    assert np.allclose(np.abs(seen.weakest_direction), [1, 0, 0], atol=1e-6)


def test_eigenvalues_do_not_depend_on_the_frame() -> None:
    points, normals = ALL_SIDES
    turn = Rotation.from_euler("z", 0.7).as_matrix()[:2, :2]
    moved = observability(points @ turn.T + [1.0, -2.0], normals @ turn.T)
    assert np.allclose(moved.eigenvalues, observability(points, normals).eigenvalues)


def test_residuals_change_as_the_rows_say() -> None:
    points, normals = ALL_SIDES
    step, scale = 1e-6, 0.030
    centre = points.mean(axis=0)
    for index, motion in enumerate([(step / scale, 0, 0), (0, step, 0), (0, 0, step)]):
        turn = Rotation.from_euler("z", motion[0]).as_matrix()[:2, :2]
        moved = (points - centre) @ turn.T + centre + motion[1:]
        change = np.sum((points - moved) * normals, axis=1) / step
        assert np.allclose(jacobian(points, normals, scale)[:, index], change, atol=1e-4)


def test_planar_observability_of_a_solid_ignores_heights() -> None:
    points, normals = ALL_SIDES
    lifted = np.column_stack([points, [0.01, 0.05, 0.02, 0.07]])
    upright = np.column_stack([normals, np.zeros(4)])
    assert planar_observability(lifted, upright).smallest == pytest.approx(observability(points, normals).smallest)
    assert observability(lifted, upright).smallest == pytest.approx(0.0, abs=1e-12)
