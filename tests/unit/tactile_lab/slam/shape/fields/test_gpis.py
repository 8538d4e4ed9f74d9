"""The Gaussian process implicit surface against known answers, and on contacts a hand could bring."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields import gpis as gpis_module
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.observations import offsurface_observations
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tests.support.shape_examples import contacts_on_polygon, contacts_on_sphere, rectangle

KERNELS = ["squared_exponential", "matern52", "thin_plate"]
THESIS = GpisSettings(
    observations="offsurface", kernel="squared_exponential", prior_mean="zero", amplitude_m=0.01, length_m=0.03
)


def scikit_learn_twin(field: Gpis) -> GaussianProcessRegressor:
    """The same process over the same values; its RBF divides by 2 length^2, (2.15) by length^2."""
    kernel = ConstantKernel(THESIS.amplitude_m**2, "fixed") * RBF(THESIS.length_m / np.sqrt(2), "fixed")
    twin = GaussianProcessRegressor(kernel, alpha=field.observations.value_sigma_m**2, optimizer=None)
    return twin.fit(field.observations.points_m, field.observations.values_m)


@pytest.mark.parametrize("dimension", [2, 3])
def test_value_only_fields_agree_with_scikit_learn(dimension: int) -> None:
    points, normals = contacts_on_sphere(0.04, 20, dimension, seed=0)
    field = Gpis.fit(points, normals, 0.001, 0.1, THESIS)
    twin = scikit_learn_twin(field)
    queries = np.random.default_rng(1).uniform(-0.06, 0.06, (50, dimension))
    mean, deviation = twin.predict(queries, return_std=True)
    np.testing.assert_allclose(field.mean(queries), mean, atol=1e-8)
    np.testing.assert_allclose(np.sqrt(field.variance(queries)), deviation, atol=1e-8)
    assert field.log_marginal_likelihood() == pytest.approx(twin.log_marginal_likelihood_value_, rel=1e-6)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("observations", ["normals", "offsurface"])
@pytest.mark.parametrize("prior_mean", ["zero", "outward"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_gradient_is_the_derivative_of_the_mean(
    kernel: str, observations: str, prior_mean: str, dimension: int
) -> None:
    points, normals = contacts_on_sphere(0.04, 12, dimension, seed=2)
    field = Gpis.fit(
        points,
        normals,
        settings=GpisSettings(kernel=kernel, observations=observations, prior_mean=prior_mean, length_m=0.04),
    )
    queries = np.random.default_rng(3).uniform(-0.06, 0.06, (8, dimension))
    step = 1e-6
    numeric = [(field.mean(queries + e) - field.mean(queries - e)) / (2 * step) for e in step * np.eye(dimension)]
    np.testing.assert_allclose(field.gradient(queries), np.stack(numeric, axis=1), atol=1e-6)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    kernel=st.sampled_from(KERNELS),
    observations=st.sampled_from(["normals", "offsurface"]),
    dimension=st.sampled_from([2, 3]),
    count=st.integers(1, 12),
    length_m=st.floats(0.015, 0.12),
    seed=st.integers(0, 1000),
)
def test_likelihood_gradient_agrees_with_central_differences(
    kernel: str, observations: str, dimension: int, count: int, length_m: float, seed: int
) -> None:
    points, normals = contacts_on_sphere(0.04, count, dimension, seed)
    field = Gpis.fit(
        points, normals, settings=GpisSettings(kernel=kernel, observations=observations, length_m=length_m)
    )
    found = field.log_marginal_likelihood_gradient()
    here = np.append(field.kernel.log_parameters, 0.0)
    for index, shift in enumerate(1e-4 * np.eye(len(here))):
        ahead = field.with_log_parameters(here + shift).log_marginal_likelihood()
        behind = field.with_log_parameters(here - shift).log_marginal_likelihood()
        assert found[index] == pytest.approx((ahead - behind) / 2e-4, rel=1e-4, abs=1e-3)


def test_optimising_raises_the_likelihood_and_repeats_exactly() -> None:
    points, normals = contacts_on_polygon(rectangle(), 40, seed=0)
    field = Gpis.fit(points, normals)
    better = field.optimise()
    assert better.log_marginal_likelihood() > field.log_marginal_likelihood() + 1
    np.testing.assert_allclose(better.log_marginal_likelihood_gradient()[:2], 0.0, atol=0.5)
    assert field.optimise().kernel == better.kernel


def test_optimising_the_noise_finds_that_contacts_are_better_than_stated() -> None:
    points, normals = contacts_on_sphere(0.04, 40, 2, seed=1)
    assert Gpis.fit(points, normals, 0.003, 0.2).optimise(noise=True).noise_scale < 0.5


@pytest.mark.parametrize("kernel", KERNELS)
def test_exact_contacts_are_interpolated_with_their_normals(kernel: str) -> None:
    points, normals = contacts_on_sphere(0.04, 15, 2, seed=5)
    field = Gpis.fit(points, normals, 1e-6, 1e-4, GpisSettings(kernel=kernel))
    np.testing.assert_allclose(field.mean(points), 0.0, atol=2e-5)
    np.testing.assert_allclose(field.gradient(points), normals, atol=2e-2)


@pytest.mark.parametrize("kernel", KERNELS)
def test_variance_is_the_contacts_at_the_data_and_grows_away_from_it(kernel: str) -> None:
    points, normals = contacts_on_sphere(0.04, 20, 2, seed=6)
    field = Gpis.fit(points, normals, 0.001, 0.1, GpisSettings(kernel=kernel))
    sigma_at_data = np.sqrt(field.variance(points))
    along = np.outer([1.0, 1.25, 1.5, 2.0, 3.0], points[0])
    assert sigma_at_data.max() < 0.00101
    assert (np.diff(field.variance(along)) > 0).all()


@pytest.mark.parametrize("dimension", [2, 3])
def test_field_is_nearly_a_signed_distance_in_metres(dimension: int) -> None:
    points, normals = contacts_on_sphere(0.04, 60, dimension, seed=7)
    field = Gpis.fit(points, normals).optimise()
    for offset_m in (-0.010, -0.005, 0.005, 0.010):
        np.testing.assert_allclose(field.mean(points + offset_m * normals), offset_m, atol=0.0015)


def test_thesis_labels_are_reached_at_their_distance() -> None:
    points, normals = contacts_on_sphere(0.04, 20, 2, seed=8)
    field = Gpis.fit(points, normals, 0.0005, 0.1, THESIS)
    np.testing.assert_allclose(field.mean(points + 0.005 * normals), 0.005, atol=5e-4)
    np.testing.assert_allclose(field.mean(points - 0.005 * normals), -0.005, atol=5e-4)


def test_spatial_offsurface_points_include_the_enclosing_sphere_and_only_true_inner_ones() -> None:
    points, normals = contacts_on_sphere(0.04, 20, 3, seed=9)
    seen = offsurface_observations(points, normals, np.full(20, 0.001), 0.005)
    radius = np.linalg.norm(seen.points_m, axis=1)
    assert len(seen.points_m) > 3 * 20 + 60
    assert (radius[seen.values_m > 0] > 0.04).all()
    assert (radius[seen.values_m < 0] < 0.04).all()


def test_inner_sphere_is_left_out_where_contacts_lie_on_one_face() -> None:
    points = np.column_stack([np.random.default_rng(0).uniform(-0.03, 0.03, (20, 2)), np.zeros(20)])
    normals = np.tile([0.0, 0.0, 1.0], (20, 1))
    seen = offsurface_observations(points, normals, np.full(20, 0.001), 0.005)
    assert (seen.points_m[seen.values_m < 0, 2] < 0).all()


def test_outward_prior_leaves_untouched_space_outside() -> None:
    points, normals = contacts_on_polygon(rectangle(), 10, seed=1)
    far = np.random.default_rng(0).uniform(-1, 1, (200, 2))
    far = far[np.linalg.norm(far, axis=1) > 0.2]
    assert (Gpis.fit(points, normals).mean(far) > 0.1).all()


def test_precise_contacts_weigh_more_than_vague_ones() -> None:
    points = np.array([[0.0, 0.001], [0.0, -0.001]])
    normals = np.array([[0.0, 1.0], [0.0, 1.0]])
    field = Gpis.fit(points, normals, np.array([1e-4, 1e-2]), np.array([0.1, 0.1]))
    assert abs(field.mean(points)[0]) < 2e-4 < abs(field.mean(points)[1])


def test_repeated_contacts_do_not_break_the_fit() -> None:
    points, normals = contacts_on_sphere(0.04, 5, 2, seed=0)
    field = Gpis.fit(np.tile(points, (6, 1)), np.tile(normals, (6, 1)), 0.0, 0.0)
    assert np.isfinite(field.mean(points)).all()


def test_prediction_does_not_depend_on_the_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    points, normals = contacts_on_sphere(0.04, 10, 3, seed=0)
    field = Gpis.fit(points, normals)
    queries = np.random.default_rng(0).uniform(-0.06, 0.06, (101, 3))
    whole = field.predict(queries, gradient=True, variance=True)
    monkeypatch.setattr(gpis_module, "_BLOCK_ENTRIES", 400)
    parts = field.predict(queries, gradient=True, variance=True)
    np.testing.assert_allclose(parts.mean_m, whole.mean_m, atol=1e-14)
    np.testing.assert_allclose(parts.gradient, whole.gradient, atol=1e-12)
    np.testing.assert_allclose(parts.variance_m2, whole.variance_m2, atol=1e-14)


def test_what_is_not_asked_for_is_empty_and_no_query_gives_no_answer() -> None:
    points, normals = contacts_on_sphere(0.04, 4, 2, seed=0)
    field = Gpis.fit(points, normals)
    assert field.predict(points).gradient.shape == (0, 2)
    assert field.predict(points).variance_m2.shape == (0,)
    nothing = field.predict(np.empty((0, 2)), gradient=True, variance=True)
    assert (nothing.mean_m.shape, nothing.gradient.shape, nothing.variance_m2.shape) == ((0,), (0, 2), (0,))


def test_moving_the_contacts_moves_the_field_with_them() -> None:
    points, normals = contacts_on_polygon(rectangle(), 15, seed=4)
    queries = np.random.default_rng(5).uniform(-0.06, 0.06, (20, 2))
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    shift = np.array([0.3, -0.2])
    here = Gpis.fit(points, normals, settings=GpisSettings(prior_mean="zero"))
    there = Gpis.fit(points @ turn.T + shift, normals @ turn.T, settings=GpisSettings(prior_mean="zero"))
    np.testing.assert_allclose(there.mean(queries @ turn.T + shift), here.mean(queries), atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points_m": np.empty((0, 2)), "normals": np.empty((0, 2))}, "no contacts"),
        ({"points_m": np.array([[np.nan, 0.0], [0.0, 0.0]])}, "contact 0 has a coordinate that is not a number"),
        ({"normals": np.array([[1.0, 0.0], [0.0, np.inf]])}, "contact 1 has a coordinate that is not a number"),
        ({"normals": np.array([[1.0, 0.0], [0.0, 0.2]])}, "normal of contact 1 has length 0.2"),
        ({"normals": np.array([[1.0, 0.0]])}, "do not match"),
        ({"point_sigma_m": np.array([0.001])}, "as many standard deviations"),
        ({"point_sigma_m": np.array([0.001, -0.001])}, "cannot be negative"),
        ({"points_m": np.array([[0.0, 0.0], [60.0, 40.0]])}, "millimetres"),
    ],
)
def test_unusable_contacts_are_refused_with_the_reason(change: dict[str, np.ndarray], message: str) -> None:
    usable = {"points_m": np.array([[0.0, 0.0], [0.05, 0.0]]), "normals": np.array([[-1.0, 0.0], [1.0, 0.0]])}
    with pytest.raises(ShapeError, match=message):
        Gpis.fit(**{**usable, **change})
