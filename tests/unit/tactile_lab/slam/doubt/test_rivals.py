"""Alternatives to an estimate, and turns that no contact can tell."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.slam.doubt.rivals import alternatives, doubts_of, turned_by_symmetry
from tactile_lab.slam.doubt.spread import spread_by
from tactile_lab.slam.doubt.symmetry import ROUND, Symmetry, symmetry_of
from tactile_lab.slam.shape.surfaces.surface import Contour
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()


def regular(sides: int, radius_m: float = 0.045, shift_m: tuple[float, float] = (0.01, -0.02)) -> np.ndarray:
    angles = 2 * np.pi * np.arange(sides) / sides
    return radius_m * np.column_stack([np.cos(angles), np.sin(angles)]) + shift_m


def contour(points_m: np.ndarray) -> Contour:
    return Contour(points_m, np.full(len(points_m), 0.001), is_closed=True)


@pytest.mark.parametrize(
    ("outline_m", "order"),
    [
        (regular(3), 3),
        (regular(6), 6),
        (regular(8), 8),
        (regular(60), ROUND),
        (OUTLINES_m["square"], 4),
        (OUTLINES_m["rectangle"], 2),
        (OUTLINES_m["L"], None),
    ],
)
def test_turns_that_leave_an_outline_as_it_is(outline_m: np.ndarray, order: int | None) -> None:
    found = symmetry_of(contour(outline_m))
    assert (None if found is None else found.order) == order


def test_a_turn_about_the_axis_is_explained_by_the_symmetry_and_a_shift_is_not() -> None:
    found = symmetry_of(contour(regular(6)))
    assert found is not None
    assert found.explains(found.offset(1), 0.002)
    assert found.explains(found.offset(-2), 0.002)
    for off in ([0.01, 0.0, 0.0], [0.0, 0.0, 0.3]):
        assert not found.explains(found.offset(1) + np.array(off), 0.002)


def moved(contact_map: ContactMap, grasps: slice, offset: np.ndarray) -> ContactMap:
    rows = contact_map.rows
    rows[grasps] = contact_map.space.compose(rows[grasps], offset)
    return contact_map.with_rows(rows)


def test_rivals_are_told_with_their_grasps_and_probabilities() -> None:
    best = true_map("rectangle", seed=5)
    run = moved(best, slice(4, None), np.array([0.0, 0.0, 0.8]))  # all but the first four: the same as those four
    one = moved(best, slice(7, 8), np.array([0.03, 0.0, 0.0]))
    same = moved(best, slice(None), np.array([0.02, 0.0, 0.5]))
    hopeless = moved(best, slice(9, 10), np.array([0.03, 0.0, 0.0]))
    found = alternatives(best, [(hopeless, 9.0), (same, 0.0), (one, 2.0), (run, 0.5)], None, 0.0)
    assert [each.grasps for each in found] == [(0, 1, 2, 3), (7,)]
    weights = np.exp([-0.25, -1.0, -4.5])
    assert found[0].probability == pytest.approx(weights[0] / (1 + weights.sum()))
    assert found[1].shift_m == pytest.approx(0.03)
    (doubt,) = doubts_of(found)
    assert doubt.grave
    assert "grasps 1 to 4 turned by 46°" in doubt.words
    assert doubts_of(found[:0]) == ()


def test_what_an_alternative_adds_to_the_covariances_is_its_square_times_its_probability() -> None:
    best = true_map("rectangle", seed=5)
    found = alternatives(best, [(moved(best, slice(7, 8), np.array([0.03, 0.0, 0.0])), 2.0)], None, 0.0)
    chance = found[0].probability
    spread = spread_by(found, best)
    expected = np.zeros(len(best.rows))
    expected[7] = chance * 0.03**2
    np.testing.assert_allclose(np.trace(spread.birth[:, :2, :2], axis1=1, axis2=2), expected, atol=1e-9)
    shares = np.where(np.arange(12) == 7, 11 / 12, 1 / 12)  # the best common frame goes a twelfth of the way with it
    added = np.trace(spread.common[:, :2, :2], axis1=1, axis2=2)
    np.testing.assert_allclose(added, chance * (0.03 * shares) ** 2, rtol=0.05)


def test_where_the_first_grasp_may_be_elsewhere_all_others_are_uncertain_in_its_frame() -> None:
    best = true_map("rectangle", seed=5)
    found = alternatives(best, [(moved(best, slice(0, 1), np.array([0.03, 0.0, 0.0])), 0.0)], None, 0.0)
    added = np.trace(spread_by(found, best).birth[:, :2, :2], axis1=1, axis2=2)
    assert added[0] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(added[1:], 0.5 * 0.03**2, rtol=1e-3)


def test_turns_of_a_hexagon_are_no_alternatives() -> None:
    best = true_map("rectangle", seed=5)
    hexagon = Symmetry(6, np.array([0.01, 0.0]))
    turned, shifted = (moved(best, slice(7, 8), hexagon.offset(1) + off) for off in (np.zeros(3), [0.02, 0.0, 0.0]))
    assert alternatives(best, [(turned, 0.0)], hexagon, 0.0) == ()
    assert len(alternatives(best, [(shifted, 0.0)], hexagon, 0.0)) == 1


def test_quarter_turns_of_a_square_are_alternatives_where_it_slipped_far() -> None:
    best = true_map("square", seed=5, count=8)
    found = turned_by_symmetry(best, Symmetry(4, np.zeros(2)), NOISE, 2.0)
    assert found
    gaps = [gap for _, gap in found]
    assert -3.0 < min(gaps) < max(gaps) < 8.0
    assert turned_by_symmetry(best, Symmetry(6, np.zeros(2)), NOISE, 2.0) == []
