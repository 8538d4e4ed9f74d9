"""Where fingers were there is no object: which places are free, and what a shape that covers them costs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from drivers.core.contacts import ApproachPath
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.tracking.contacts.free_space import fingertip_places, free_space_costs, places_on_line
from tests.support.shape_examples import contacts_on_sphere


def path(length_m: float, *, touched: bool) -> ApproachPath:
    end = np.array([0.4, 0.1, 0.03])
    return ApproachPath("FF", end + length_m * np.array([0.6, 0.0, 0.8]), end, touched)


def distances_mm(line: ApproachPath) -> list[float]:
    """Of the free places from the path's end; all lie on the path."""
    places = places_on_line(line)
    away = places - line.end_world_m
    lengths = np.linalg.norm(away, axis=1)
    np.testing.assert_allclose(away, lengths[:, None] * [[0.6, 0.0, 0.8]], atol=1e-12)
    return (1e3 * lengths).round(6).tolist()


def test_before_a_contact_a_few_places_of_the_path_are_free() -> None:
    assert distances_mm(path(0.05, touched=True)) == [4.0, 10.0, 20.0, 35.0]
    assert distances_mm(path(0.015, touched=True)) == [4.0, 10.0]


def test_all_of_a_path_that_met_nothing_is_free_at_every_centimetre() -> None:
    assert distances_mm(path(0.03, touched=False)) == [4.0, 14.0, 24.0]


@pytest.mark.parametrize("touched", [True, False])
def test_a_path_shorter_than_a_fingertips_surface_is_certain_says_nothing(touched: bool) -> None:
    assert places_on_line(path(0.0035, touched=touched)).shape == (0, 3)


def test_a_fingertip_without_a_path_is_free_along_its_normal() -> None:
    places = fingertip_places(np.array([0.01, 0.02]), np.array([0.0, 1.0]))
    np.testing.assert_allclose(places, [[0.01, 0.024], [0.01, 0.028], [0.01, 0.032], [0.01, 0.036]])


def test_free_places_cost_as_much_as_they_are_likely_to_be_inside_each_half() -> None:
    gpis = Gpis.fit(*contacts_on_sphere(0.03, 24, 2, seed=0), 1e-3, 0.09)
    places = np.array([[[0.05, 0.0], [0.0, 0.034]], [[0.0, 0.0], [0.05, 0.0]]])
    outside, inside = free_space_costs(gpis, places)
    assert outside < 0.1
    assert inside > 10.0
    mean, sigma = gpis.mean(places[1]), np.sqrt(gpis.variance(places[1], rough=True) + 0.001**2)
    assert inside == pytest.approx(-0.5 * np.sum(norm.logcdf((mean + 0.001) / sigma)))
