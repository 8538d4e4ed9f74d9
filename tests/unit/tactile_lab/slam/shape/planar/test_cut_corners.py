"""A corner that no contact is near may be cut off, and the outline says how uncertain it is there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.cut_corners import HIDDEN_SHARE, CutCorner
from tactile_lab.slam.shape.planar.polygon import Polygon
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, segment
from tests.support.shape_examples import NORMAL_SIGMA_rad, POINT_SIGMA_m, contacts_on_polygon, rectangle

PER_m = 200.0
gaps = st.floats(0.001, 0.05)


def right_angle(before_m: float, after_m: float, per_m: float = PER_m) -> CutCorner:
    return CutCorner.of(np.zeros(2), np.array([[-before_m, 0.0], [0.0, after_m]]), per_m)


def outline_without(near_m: Array, radius_m: float) -> Polygon:
    """A rectangle of 80 contacts, none of them near a place."""
    points_m, normals = contacts_on_polygon(rectangle(), 80, 3, 1.0)
    far = np.linalg.norm(points_m - near_m, axis=1) > radius_m
    contacts = PlanarContacts.of(points_m[far], normals[far], POINT_SIGMA_m, NORMAL_SIGMA_rad)
    return Polygon.of(contacts, segment(contacts, rectangle()))


@given(gaps, gaps)
def test_the_deepest_cut_is_the_height_of_the_triangle_that_it_cuts_off(before_m: float, after_m: float) -> None:
    cut = right_angle(before_m, after_m)
    assert cut.depth_m == pytest.approx(before_m * after_m / np.hypot(before_m, after_m))
    assert cut.variance_m2(np.zeros(1), after=True)[0] == pytest.approx(cut.chance * cut.depth_m**2 / 3)


@given(gaps, gaps)
def test_nothing_is_hidden_at_the_last_contact_and_beyond(before_m: float, after_m: float) -> None:
    cut = right_angle(before_m, after_m)
    for gap_m, after in ((before_m, False), (after_m, True)):
        there_m = np.array([gap_m, 2 * gap_m])
        assert cut.variance_m2(there_m, after=after) == pytest.approx(np.zeros(2), abs=1e-15)


@given(gaps, gaps)
def test_a_cut_is_the_more_likely_the_more_contacts_are_missing(before_m: float, after_m: float) -> None:
    chances = [right_angle(before_m, after_m, per_m).chance for per_m in (0.0, 100.0, 400.0, 1e6)]
    assert chances[0] == pytest.approx(HIDDEN_SHARE)
    assert chances == sorted(chances)
    assert chances[-1] <= 1


def test_a_corner_that_contacts_reach_hides_nothing() -> None:
    reached = CutCorner.of(np.zeros(2), np.array([[0.0, 0.0], [0.0, 0.01]]), PER_m)
    assert reached.variance_m2(np.linspace(0, 0.01, 5), after=True) == pytest.approx(np.zeros(5))


def test_an_untouched_corner_is_less_certain_than_touched_ones_and_stands_where_it_was() -> None:
    corner_m = rectangle()[0]
    touched, untouched = outline_without(corner_m, 0.0).contour(), outline_without(corner_m, 0.03).contour()
    at = [np.linalg.norm(one.points_m - corner_m, axis=1).argmin() for one in (touched, untouched)]
    assert np.linalg.norm(untouched.points_m[at[1]] - corner_m) < 0.002
    assert untouched.sigma_m[at[1]] > 3 * touched.sigma_m[at[0]]
    far = np.linalg.norm(untouched.points_m - corner_m, axis=1) > 0.06
    assert untouched.sigma_m[far].max() < 0.001
