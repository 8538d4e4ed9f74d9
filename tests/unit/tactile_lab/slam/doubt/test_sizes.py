"""The outer size of a shape, and a shape of which an end is a guess."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tactile_lab.slam.doubt.sizes import sizes, unknown_sizes
from tactile_lab.slam.doubt.status import status_of
from tactile_lab.slam.shape.surfaces.surface import Contour

CORNERS = np.array([[0.0, 0.0], [0.10, 0.0], [0.10, 0.06], [0.0, 0.06]])
TURN = np.array([[0.8, -0.6], [0.6, 0.8]])


def outline(right_end_m: float) -> Contour:
    """A box of 100 x 60 mm, turned; its right end is known to so much."""
    return Contour(CORNERS @ TURN.T, np.array([0.0005, right_end_m, right_end_m, 0.0005]), is_closed=True)


def test_sizes_are_those_of_the_smallest_rectangle_with_the_sigma_of_both_ends() -> None:
    length, width = sizes(outline(0.003).points_m, outline(0.003).sigma_m)
    assert (length.whole.length_m, width.whole.length_m) == pytest.approx((0.10, 0.06))
    assert length.whole.sigma_m == pytest.approx(0.0005 + 0.003)
    assert width.whole.sigma_m == pytest.approx(0.00175 + 0.00175)
    assert length.touched == length.whole
    assert not length.is_guess


def test_of_a_shape_with_a_guessed_end_the_touched_span_is_known() -> None:
    """Touched are the left end and, 20 mm before the right one, the upper side."""
    points_m = np.insert(CORNERS, 3, [0.08, 0.06], axis=0) @ TURN.T
    sigma_m, known = np.array([0.0005, 0.04, 0.04, 0.0012, 0.0005]), np.array([1, 0, 0, 1, 1], bool)
    length, width = sizes(points_m, sigma_m, known)
    assert length.touched is not None
    assert (length.whole.length_m, length.touched.length_m) == pytest.approx((0.10, 0.08))
    assert length.whole.sigma_m == pytest.approx(0.0005 + 0.04)
    assert length.touched.sigma_m == pytest.approx(0.0005 + 0.0012)
    assert (length.is_guess, width.is_guess) == (True, False)
    assert width.whole.sigma_m == pytest.approx(0.0005 + (0.0005 + 0.0012) / 2)


def test_of_what_nobody_touched_nothing_is_known() -> None:
    length, _ = sizes(CORNERS, np.full(4, 0.04), np.zeros(4, bool))
    assert length.touched is None
    assert length.is_guess


def test_a_shape_whose_end_is_a_guess_is_partial_however_much_of_it_is_known() -> None:
    assert unknown_sizes(outline(0.002), CORNERS) == []
    assert unknown_sizes(None, CORNERS) == []
    (doubt,) = unknown_sizes(outline(0.040), CORNERS)
    assert "length 100 ± 40 mm" in doubt.words
    assert status_of(lost=False, known_share=0.97, doubts=[doubt]) == "partial"
    assert status_of(lost=False, known_share=0.97, doubts=[]) == "complete"


def test_an_end_that_was_touched_at_one_corner_is_no_guess() -> None:
    end, elsewhere = outline(0.040), np.array([True, False, False, True])
    unknown_at_one = replace(end, sigma_m=np.array([0.0005, 0.0005, 0.040, 0.0005]), known=np.array([1, 1, 0, 1], bool))
    assert unknown_sizes(unknown_at_one, CORNERS) == []
    (doubt,) = unknown_sizes(replace(end, known=elsewhere), CORNERS)
    assert "length 100 ± 40 mm" in doubt.words


def test_nothing_beyond_the_contacts_was_touched_however_far_a_straight_side_is_known() -> None:
    """Contacts on the left 50 mm of both long sides; the outline is known 30 mm farther."""
    places = np.linspace(0.0, 0.10, 51)
    upper, lower = (np.column_stack([places, np.full(51, y)]) for y in (0.06, 0.0))
    ring_m, known = np.vstack([lower, upper[::-1]]), np.concatenate([places < 0.081, places[::-1] < 0.081])
    contacts_m = np.array([[0.0, 0.03], [0.02, 0.0], [0.05, 0.0], [0.01, 0.06], [0.05, 0.06]])
    sigma_m = np.where(known, 0.0005, 0.040)
    length, width = sizes(ring_m @ TURN.T, sigma_m, known, contacts_m @ TURN.T)
    assert length.touched is not None
    assert width.touched is not None
    assert (length.whole.length_m, length.touched.length_m) == pytest.approx((0.10, 0.05))
    assert width.touched.length_m == pytest.approx(0.06)
    (doubt,) = unknown_sizes(Contour(ring_m @ TURN.T, sigma_m, True, known=known), contacts_m @ TURN.T)
    assert "(touched over 50 mm)" in doubt.words
    assert sizes(ring_m, sigma_m, known, np.empty((0, 2)))[0].touched is None
