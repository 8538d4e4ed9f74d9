"""Fields of what is alike along an edge: their derivatives, their evidence, and edges between contacts far apart."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tactile_lab.slam.shape.fields.drawn_field import DrawnField, PRICE_nats
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.metrics.metrics import mesh_errors
from tactile_lab.slam.shape.surfaces.surface import extract_mesh
from tests.support.solid_examples import contacts_on, field_on

COLUMN = trimesh.creation.box((0.05, 0.04, 0.15), trimesh.transformations.rotation_matrix(0.3, [0, 0, 1], [0, 0, 0]))
COLUMN.apply_translation([0.0, 0.0, 0.075])
SPHERE = trimesh.creation.icosphere(subdivisions=3, radius=0.04)


@pytest.fixture(scope="module")
def field() -> Gpis:
    return field_on(COLUMN, 40, seed=1)


@pytest.fixture(scope="module")
def drawn(field: Gpis) -> DrawnField:
    return DrawnField.along_edges(field)


def test_the_sections_have_the_heading_of_the_walls(drawn: DrawnField) -> None:
    along = np.array([np.cross(*section.plane) for section in drawn.sections])
    walls = [[0, 0, 1], [np.cos(0.3), np.sin(0.3), 0], [-np.sin(0.3), np.cos(0.3), 0]]
    np.testing.assert_allclose(along, walls, atol=0.05)


def test_the_gradient_of_the_evidence_agrees_with_differences(drawn: DrawnField) -> None:
    here = drawn.log_parameters + 0.1
    moved = drawn.with_log_parameters(here)
    steps = 1e-5 * np.eye(len(here))
    evidence = [drawn.with_log_parameters(here + sign * step) for step in steps for sign in (1, -1)]
    after, before = np.reshape([each.log_marginal_likelihood() for each in evidence], (-1, 2)).T
    numeric = (after - before) / 2e-5
    np.testing.assert_allclose(moved.log_marginal_likelihood_gradient()[: len(here)], numeric, rtol=1e-4, atol=1e-3)


def test_predictions_agree_with_each_other(drawn: DrawnField) -> None:
    places = np.random.default_rng(0).uniform([-0.03, -0.03, 0.05], [0.03, 0.03, 0.1], (6, 3))
    found = drawn.predict(places, gradient=True, variance=True)
    steps = 1e-6 * np.eye(3)
    numeric = np.array([(drawn.mean(places + step) - drawn.mean(places - step)) / 2e-6 for step in steps]).T
    np.testing.assert_allclose(found.gradient, numeric, atol=1e-6)
    np.testing.assert_allclose(found.variance_m2, np.diag(drawn.joint_covariance(places)), rtol=1e-6)


def test_contacts_that_come_later_give_the_field_of_all(drawn: DrawnField) -> None:
    seen = drawn.observations
    sigmas = seen.value_sigma_m, seen.gradient_sigma
    first = drawn.refit(drawn.contacts_m[:30], drawn.normals[:30], *(sigma[:30] for sigma in sigmas))
    grown = first.extend(drawn.contacts_m[30:], drawn.normals[30:], *(sigma[30:] for sigma in sigmas))
    assert len(grown.sections) == 3
    assert grown.log_marginal_likelihood() == pytest.approx(drawn.log_marginal_likelihood(), abs=1.0)


def test_edges_between_contacts_far_apart_are_sharper(field: Gpis, drawn: DrawnField) -> None:
    assert drawn.log_marginal_likelihood() > field.log_marginal_likelihood() + PRICE_nats
    errors = [mesh_errors(extract_mesh(each, floor_m=0.0, resolution_m=0.005), COLUMN) for each in (field, drawn)]
    assert errors[1].hausdorff_m < 0.8 * errors[0].hausdorff_m


def test_a_sphere_is_not_worth_the_price() -> None:
    field = field_on(SPHERE, 40, seed=1)
    assert DrawnField.along_edges(field).log_marginal_likelihood() < field.log_marginal_likelihood() + PRICE_nats


def test_many_contacts_share_the_parameters_of_a_selection() -> None:
    points, normals = contacts_on(COLUMN, 150, seed=2)
    drawn = DrawnField.along_edges(Gpis.fit(points, normals, 0.001, 0.1))
    assert len(drawn.contacts_m) == 150
    assert np.abs(drawn.mean(points)).max() < 0.004
