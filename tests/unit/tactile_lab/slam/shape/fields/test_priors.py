"""Prior means: gradients, signs, slopes, and primitives placed by the contacts."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.priors import EllipsoidMean, OutwardMean, PriorMean
from tactile_lab.slam.shape.fields.settings import GpisSettings, prior_mean
from tests.support.shape_examples import contacts_on_box, contacts_on_sphere, noisy

PRIMITIVES = ("sphere", "ellipsoid", "superquadric")


def ellipsoid_contacts(semi_axes_m: list[float], count: int, seed: int = 0) -> tuple[Array, Array]:
    ways, _ = contacts_on_sphere(1.0, count, len(semi_axes_m), seed)
    normals = ways / semi_axes_m
    return ways * semi_axes_m, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def prior_of(name: str, points: Array, normals: Array) -> PriorMean:
    return prior_mean(points, normals, GpisSettings.model_validate({"prior_mean": name}))


@pytest.mark.parametrize("name", ["zero", "outward", *PRIMITIVES])
@pytest.mark.parametrize("dimension", [2, 3])
def test_gradients_are_those_of_the_values(name: str, dimension: int) -> None:
    prior = prior_of(name, *noisy(*ellipsoid_contacts([0.05, 0.03, 0.02][:dimension], 30), seed=0))
    places = np.random.default_rng(1).uniform(-0.1, 0.1, (50, dimension))
    steps = 1e-7 * np.eye(dimension)
    numeric = np.stack([(prior.value(places + s) - prior.value(places - s)) / 2e-7 for s in steps], axis=1)
    np.testing.assert_allclose(prior.gradient(places), numeric, atol=1e-5)


@pytest.mark.parametrize("name", PRIMITIVES)
@pytest.mark.parametrize("dimension", [2, 3])
def test_primitives_are_negative_inside_positive_outside_and_near_slope_one(name: str, dimension: int) -> None:
    points, normals = ellipsoid_contacts([0.045, 0.035, 0.030][:dimension], 40)
    prior = prior_of(name, points + 0.1, normals)
    assert (prior.value(points + 0.1 + 0.02 * normals) > 0).all()
    assert (prior.value(points + 0.1 - 0.02 * normals) < 0).all()
    slope = np.linalg.norm(prior.gradient(points + 0.1), axis=1)
    assert 0.6 < slope.min() <= slope.max() < 1.6


@pytest.mark.parametrize("semi_axes_m", [[0.05, 0.03], [0.05, 0.03, 0.02]])
def test_an_ellipsoid_is_recovered_with_its_pose(semi_axes_m: list[float]) -> None:
    points, normals = ellipsoid_contacts(semi_axes_m, 30)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(len(semi_axes_m),) * 2))[0]
    prior = EllipsoidMean.ellipsoid_around(points @ turn.T + 0.07, normals @ turn.T)
    assert np.abs(prior.value(points @ turn.T + 0.07)).max() < 0.006
    np.testing.assert_allclose(prior.centre_m, 0.07, atol=0.002)
    found = np.sort(np.linalg.eigvalsh(prior.matrix) ** -0.5)
    np.testing.assert_allclose(found, np.sort(semi_axes_m), rtol=0.2)


def test_a_sphere_is_recovered_from_one_cap() -> None:
    points, normals = contacts_on_sphere(0.04, 200, 3, seed=0)
    cap = normals[:, 2] > 0.6
    prior = EllipsoidMean.sphere_around(points[cap] + 0.1, normals[cap])
    np.testing.assert_allclose(prior.centre_m, 0.1, atol=0.001)
    assert prior.factor_m == pytest.approx(0.04, abs=0.001)


def test_equation_2_19_is_kept_to_the_letter() -> None:
    matrix, centre, factor = np.diag([1 / 0.05**2, 1 / 0.03**2]), np.array([0.01, 0.02]), 0.7
    prior = EllipsoidMean(centre, matrix, factor)
    assert prior.value(np.array([[0.06, 0.05]]))[0] == pytest.approx(0.35 * (1 + 1 - 1))
    assert prior.value(centre[None])[0] == pytest.approx(-0.35)


@pytest.mark.parametrize("name", PRIMITIVES)
@pytest.mark.parametrize("dimension", [2, 3])
def test_too_few_contacts_still_place_a_primitive_of_plausible_size(name: str, dimension: int) -> None:
    for count in (1, 4):
        points = 0.01 * np.arange(count * dimension).reshape(count, dimension) * np.eye(dimension)[0]
        prior = prior_of(name, points, np.tile(np.eye(dimension)[1], (count, 1)))
        assert np.isfinite(prior.value(points)).all()
        far = points.mean(axis=0) + 0.5 * np.eye(dimension)
        assert (prior.value(far) > 0).all()


def test_a_sphere_completes_what_was_touched_on_one_side_only() -> None:
    points, normals = contacts_on_sphere(0.035, 120, 3, seed=1)
    seen = normals[:, 0] > 0.2
    back = np.array([[-0.035, 0.0, 0.0]])
    errors = {}
    for name in ("zero", "outward", "sphere", "ellipsoid"):
        settings = GpisSettings.model_validate({"prior_mean": name, "length_m": 0.03})
        errors[name] = abs(Gpis.fit(points[seen], normals[seen], settings=settings).mean(back)[0])
    assert errors["sphere"] < 0.002
    assert errors["ellipsoid"] < 0.005
    assert errors["outward"] > 3 * errors["sphere"]


def test_the_outward_prior_is_positive_everywhere() -> None:
    points, _ = contacts_on_box(np.array([0.1, 0.06, 0.06]), 30, seed=0)
    assert OutwardMean.around(points, 0.02).value(np.zeros((1, 3)))[0] > 0
