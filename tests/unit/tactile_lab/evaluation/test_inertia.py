"""Moments and axes of bodies whose inertia is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from sessions.perception.weighing.value import Value
from tactile_lab.evaluation.inertia import EvenBody, PrincipalInertia

SIDES_m = np.array([0.12, 0.08, 0.05])
SQUARES = SIDES_m**2
MASS = Value(0.3, 0.006)
MOMENTS = MASS.value / 12 * (SQUARES.sum() - SQUARES)
TURN = Rotation.from_euler("z", 25, degrees=True)


def box(sigma_m: float = 0.0, mass: Value = MASS) -> EvenBody:
    """A box turned by 25 degrees about the vertical, with vertices between its corners."""
    surface = trimesh.creation.box(SIDES_m).subdivide().subdivide()
    surface.vertices = TURN.apply(surface.vertices) + np.array([0.1, -0.2, 0.03])
    return EvenBody(surface, np.full(len(surface.vertices), sigma_m), mass)


def test_a_box_has_the_moments_and_axes_of_the_textbook() -> None:
    found = box().principal()
    np.testing.assert_allclose(found.moments_kg_m2, MOMENTS, rtol=1e-9)
    np.testing.assert_allclose(np.abs(found.axes @ TURN.as_matrix()), np.eye(3), atol=1e-9)
    assert np.linalg.det(found.axes) == pytest.approx(1.0)
    np.testing.assert_allclose(found.moments_sigma_kg_m2, MOMENTS * MASS.sigma / MASS.value, rtol=1e-9)
    assert np.all(found.axes_sigma_rad < 1e-6)


def test_a_surface_that_is_farther_out_makes_moments_larger_and_axes_doubtful() -> None:
    certain, sigma_m = Value(MASS.value, 0.0), 0.001
    found = box(sigma_m, certain).principal()
    others = np.array([(SIDES_m[1], SIDES_m[2]), (SIDES_m[0], SIDES_m[2]), (SIDES_m[0], SIDES_m[1])])
    expected = certain.value / 12 * 4 * sigma_m * others.sum(axis=1)  # each side is longer by two sigma
    np.testing.assert_allclose(found.moments_sigma_kg_m2, expected, rtol=0.35)  # rounded: corners move by one sigma
    assert np.all((np.radians(0.5) < found.axes_sigma_rad) & (found.axes_sigma_rad < np.radians(10)))


def test_axes_of_a_cylinder_across_it_are_any() -> None:
    radius_m, height_m = 0.03, 0.1
    surface = trimesh.creation.cylinder(radius_m, height_m, sections=256)
    found = EvenBody(surface, np.full(len(surface.vertices), 0.0005), MASS).principal()
    about, across = radius_m**2 / 2, radius_m**2 / 4 + height_m**2 / 12
    np.testing.assert_allclose(found.moments_kg_m2, MASS.value * np.array([about, across, across]), rtol=1e-3)
    np.testing.assert_allclose(np.abs(found.axes[0]), [0, 0, 1], atol=1e-9)
    assert found.axes_sigma_rad[0] < np.radians(5)
    assert np.all(found.axes_sigma_rad[1:] > np.radians(40))


def test_the_measured_centre_shifts_the_inertia_and_its_doubt_counts() -> None:
    even = box()
    off_m = np.array([0.02, -0.01])
    shifted = replace(even, measured_centre_m=even.centre_m[:2] + off_m)
    x, y = off_m
    steiner = MASS.value * np.array([[y * y, -x * y, 0.0], [-x * y, x * x, 0.0], [0.0, 0.0, x * x + y * y]])
    np.testing.assert_allclose(shifted.inertia_kg_m2 - even.inertia_kg_m2, steiner, atol=1e-12)
    doubtful = replace(shifted, centre_sigma_m=0.003)
    assert np.all(doubtful.principal().moments_sigma_kg_m2 > shifted.principal().moments_sigma_kg_m2)


def test_files_keep_it() -> None:
    found = box(0.001).principal()
    read = PrincipalInertia.from_json(found.as_json())
    np.testing.assert_array_equal(read.axes, found.axes)
    np.testing.assert_array_equal(read.moments_sigma_kg_m2, found.moments_sigma_kg_m2)
