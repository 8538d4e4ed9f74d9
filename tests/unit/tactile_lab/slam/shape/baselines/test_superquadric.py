"""Superquadrics: distances, gradients, and the fit to their own samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.baselines.superquadric import Superquadric, SuperquadricFit, fit_superquadric
from tactile_lab.slam.shape.baselines.superquadric_shape import SuperquadricShape
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m, contacts_on_box, contacts_on_sphere, noisy

TURN = Rotation.from_rotvec([0.3, 0.2, -0.5]).as_matrix()
SPATIAL = Superquadric(np.array([0.01, 0.02, -0.01]), TURN, np.array([0.05, 0.03, 0.02]), np.array([0.3, 0.8]))
PLANAR = Superquadric(
    np.array([0.01, -0.02]), np.array([[0.8, 0.6], [-0.6, 0.8]]), np.array([0.05, 0.03]), np.array([0.4])
)


def surface_of(figure: Superquadric, count: int) -> tuple[Array, Array]:
    """Exact contacts: points of the surface along random rays, and their normals."""
    ways = np.random.default_rng(0).normal(size=(count, len(figure.centre_m)))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    rays = 0.01 - figure.value(figure.centre_m + 0.01 * ways)
    points = figure.centre_m + ways * rays[:, None]
    gradient = figure.gradient(points)
    return points, gradient / np.linalg.norm(gradient, axis=1, keepdims=True)


def fitted(points: Array, normals: Array) -> SuperquadricFit:
    count = len(points)
    return fit_superquadric(points, normals, np.full(count, POINT_SIGMA_m), np.full(count, NORMAL_SIGMA_rad))


@pytest.mark.parametrize("figure", [SPATIAL, PLANAR])
def test_gradient_is_that_of_the_value(figure: Superquadric) -> None:
    dimension = len(figure.centre_m)
    places = np.random.default_rng(1).uniform(-0.08, 0.08, (100, dimension))
    steps = 1e-7 * np.eye(dimension)
    numeric = np.stack([(figure.value(places + s) - figure.value(places - s)) / 2e-7 for s in steps], axis=1)
    np.testing.assert_allclose(figure.gradient(places), numeric, atol=1e-5)


def test_points_of_equation_2_1_are_on_the_surface() -> None:
    eta, omega = np.meshgrid(np.linspace(-1.5, 1.5, 9), np.linspace(-3.1, 3.1, 11))

    def power(x: Array, exponent: float) -> Array:
        return np.asarray(np.sign(x) * np.abs(x) ** exponent)

    first, second = SPATIAL.exponents
    flat = power(np.cos(eta), first)
    unit = np.stack([flat * power(np.cos(omega), second), flat * power(np.sin(omega), second)], axis=-1)
    local = np.concatenate([unit, power(np.sin(eta), first)[..., None]], axis=-1) * SPATIAL.semi_axes_m
    points = local.reshape(-1, 3) @ SPATIAL.axes + SPATIAL.centre_m
    np.testing.assert_allclose(SPATIAL.value(points), 0, atol=1e-12)


def test_value_is_the_distance_along_the_ray_and_finite_far_out_and_at_the_centre() -> None:
    sphere = Superquadric(np.zeros(3), np.eye(3), np.full(3, 0.03), np.ones(2))
    places = np.array([[0.05, 0, 0], [0, 0.01, 0], [0, 0, 0], [100.0, 100, 100]])
    np.testing.assert_allclose(sphere.value(places), [0.02, -0.02, -0.03, np.sqrt(3) * 100 - 0.03])
    assert np.isfinite(SPATIAL.gradient(np.vstack([places, SPATIAL.centre_m]))).all()


@pytest.mark.parametrize("figure", [SPATIAL, PLANAR])
def test_a_superquadric_recovers_its_own_samples(figure: Superquadric) -> None:
    found = fitted(*surface_of(figure, 40)).superquadric
    np.testing.assert_allclose(found.centre_m, figure.centre_m, atol=1e-4)
    np.testing.assert_allclose(np.sort(found.semi_axes_m), np.sort(figure.semi_axes_m), atol=2e-4)
    assert np.abs(found.value(surface_of(figure, 300)[0])).max() < 2e-4


def test_noisy_contacts_give_a_surface_within_its_own_sigma() -> None:
    fit = fitted(*noisy(*surface_of(SPATIAL, 60), seed=3))
    truth = surface_of(SPATIAL, 200)[0]
    error, sigma = np.abs(fit.superquadric.value(truth)), fit.sigma(truth)
    assert np.mean(error < 2.5 * sigma) > 0.8
    assert sigma.max() < 0.003


def test_a_box_gets_small_exponents_and_a_sphere_exponents_near_one() -> None:
    box = fitted(*contacts_on_box(np.array([0.12, 0.07, 0.05]), 60, seed=0)).superquadric
    assert box.exponents.max() < 0.3
    ball = fitted(*contacts_on_sphere(0.03, 40, 3, seed=0)).superquadric
    np.testing.assert_allclose(ball.exponents, 1.0, atol=0.1)


def test_evidence_prefers_the_right_exponents() -> None:
    points, normals = noisy(*contacts_on_box(np.array([0.12, 0.07, 0.05]), 60, seed=0), seed=0)
    sigmas = (np.full(60, POINT_SIGMA_m), np.full(60, NORMAL_SIGMA_rad))
    ellipsoid = fit_superquadric(points, normals, *sigmas, exponents=np.ones(2))
    np.testing.assert_array_equal(ellipsoid.superquadric.exponents, [1.0, 1.0])
    assert fit_superquadric(points, normals, *sigmas).log_evidence > ellipsoid.log_evidence + 100


def test_shapes_are_closed_cut_at_the_floor_and_know_their_dimension() -> None:
    shape = SuperquadricShape(fitted(*surface_of(SPATIAL, 40)))
    mesh = shape.mesh(0.004, floor_m=-0.02)
    assert mesh.is_closed
    assert mesh.vertices[:, 2].min() == pytest.approx(-0.02, abs=1e-6)
    assert np.abs(SPATIAL.value(mesh.vertices[mesh.vertices[:, 2] > -0.019])).max() < 0.002
    with pytest.raises(ShapeError, match="no outline"):
        shape.contour()
    outline = SuperquadricShape(fitted(*surface_of(PLANAR, 40)))
    assert np.abs(PLANAR.value(outline.contour().points_m)).max() < 0.0005
    with pytest.raises(ShapeError, match="no surface"):
        outline.mesh()


def test_contacts_on_one_face_leave_the_other_sides_uncertain() -> None:
    points = np.column_stack([np.zeros(12), np.linspace(-0.03, 0.03, 12)])
    fit = fitted(points, np.tile([1.0, 0.0], (12, 1)))
    far_side = fit.superquadric.centre_m * 2
    assert fit.sigma(far_side[None])[0] > 0.005
