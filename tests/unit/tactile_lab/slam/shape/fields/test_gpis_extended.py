"""Appended contacts: the factor grows, and the field is that of a fresh fit with the same kernel and prior."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.kernels import (
    Matern52,
    SquaredExponential,
    ThinPlate,
    covariance,
    cross_covariance_with_gradients,
)
from tactile_lab.slam.shape.fields.row_factor import RowFactor
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tests.support.shape_examples import contacts_on_box, contacts_on_polygon, l_block, noisy


def contacts(dimension: int, count: int) -> tuple[Array, Array]:
    if dimension == 2:
        return contacts_on_polygon(l_block(), count, seed=1)
    return noisy(*contacts_on_box(np.array([0.12, 0.06, 0.06]), count, seed=1), seed=1)


def fresh(grown: Gpis) -> Gpis:
    """The same contacts, kernel and prior, factorised at once."""
    return Gpis(
        grown.contacts_m,
        grown.normals,
        grown.settings,
        grown.observations,
        grown.kernel,
        grown.prior,
        grown.noise_scale,
    )


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.sampled_from([2, 3]), st.lists(st.integers(1, 6), min_size=1, max_size=4))
def test_contacts_appended_in_groups_give_the_field_of_a_fresh_fit(dimension: int, groups: list[int]) -> None:
    points, normals = contacts(dimension, 10 + sum(groups))
    sigmas = np.random.default_rng(0).uniform(0.0005, 0.002, len(points))
    field = Gpis.fit(points[:10], normals[:10], sigmas[:10])
    for size in groups:
        at = slice(len(field.contacts_m), len(field.contacts_m) + size)
        field = field.extend(points[at], normals[at], sigmas[at])
    again = fresh(field)
    asked = points + 0.004 * normals
    ours, theirs = (one.predict(asked, gradient=True, variance=True) for one in (field, again))
    assert ours.mean_m == pytest.approx(theirs.mean_m, abs=1e-10)
    assert ours.gradient == pytest.approx(theirs.gradient, abs=1e-8)
    assert ours.variance_m2 == pytest.approx(theirs.variance_m2, rel=1e-6)
    assert field.log_marginal_likelihood() == pytest.approx(again.log_marginal_likelihood(), abs=1e-6)
    assert field.log_marginal_likelihood_gradient() == pytest.approx(again.log_marginal_likelihood_gradient(), rel=1e-6)
    assert field.observations.points_m.tolist() == points.tolist()


def test_the_field_that_was_extended_stays_as_it_was() -> None:
    points, normals = contacts(2, 20)
    field = Gpis.fit(points[:15], normals[:15])
    before = field.mean(points)
    field.extend(points[15:], normals[15:])
    assert field.mean(points).tolist() == before.tolist()


def test_a_contact_that_repeats_another_exactly_is_appended_all_the_same() -> None:
    points, normals = contacts(2, 12)
    field = Gpis.fit(points, normals, point_sigma_m=0.0, normal_sigma_rad=0.0)
    again = field.extend(points[:1], normals[:1], 0.0, 0.0)
    assert again.mean(points) == pytest.approx(np.zeros(12), abs=1e-3)


def test_off_surface_points_are_made_anew() -> None:
    thesis = GpisSettings(observations="offsurface", kernel="thin_plate", prior_mean="zero")
    points, normals = contacts(3, 30)
    field = Gpis.fit(points[:25], normals[:25], settings=thesis).extend(points[25:], normals[25:])
    assert field.mean(points) == pytest.approx(fresh(field).mean(points))
    assert len(field.contacts_m) == 30


def test_appended_contacts_in_other_units_are_refused() -> None:
    points, normals = contacts(2, 12)
    with pytest.raises(ShapeError, match="millimetres"):
        Gpis.fit(points, normals).extend(1e5 * points[:2], normals[:2])


@pytest.mark.parametrize("kernel", [SquaredExponential(4e-4, 0.05), Matern52(4e-4, 0.08), ThinPlate(0.4, 4e-4)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_cross_covariance_with_gradients_is_a_block_of_the_covariance(kernel: Matern52, dimension: int) -> None:
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (9, dimension))
    whole = covariance(kernel, points, 9)
    places = np.arange(len(whole)).reshape(dimension + 1, 9)
    new, old = places[:, 6:].ravel(), places[:, :6].ravel()
    assert cross_covariance_with_gradients(kernel, points[6:], points[:6], 6) == pytest.approx(whole[np.ix_(new, old)])


def test_rough_variances_keep_sigma_to_half_a_percent() -> None:
    points, normals = contacts(3, 80)
    field = Gpis.fit(points, normals).optimise()
    asked = np.random.default_rng(0).uniform(-0.08, 0.08, (300, 3))
    asked[:80] = points
    assert np.sqrt(field.variance(asked, rough=True)) == pytest.approx(np.sqrt(field.variance(asked)), rel=0.005)


def test_rough_variances_are_exact_where_single_precision_would_not_do() -> None:
    points, normals = contacts(2, 40)
    field = Gpis.fit(points, normals, point_sigma_m=1e-5, normal_sigma_rad=1e-3)
    assert field.variance(points, rough=True).tolist() == field.variance(points).tolist()


def test_a_factor_with_more_rows_is_that_of_the_whole_covariance() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(7, 9))
    whole, noise = root @ root.T, rng.uniform(0.1, 0.5, 7)
    noisy_whole = whole + np.diag(noise)
    first = RowFactor.of(whole[:4, :4].copy(), noise[:4])
    assert first is not None
    grown = first.extend(whole[4:, :4], noisy_whole[4:, 4:], np.arange(4), np.arange(4, 7))
    assert grown is not None
    right = rng.normal(size=7)
    assert grown.solve(right) == pytest.approx(np.linalg.solve(noisy_whole, right), rel=1e-6)
    assert grown.log_determinant == pytest.approx(np.linalg.slogdet(noisy_whole)[1])
