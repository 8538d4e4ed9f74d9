"""Straight and round sides: found where contacts lie on them, refused where nothing is round, with stated errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.metrics.metrics import contour_errors
from tactile_lab.slam.shape.planar.rounded_outline import RoundedOutline
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts
from tactile_lab.slam.shape.planar.sides import divide_into_sides
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon
from tests.support.shape_examples import (
    NORMAL_SIGMA_rad,
    POINT_SIGMA_m,
    contacts_on_polygon,
    ellipse,
    half_disc,
    rectangle,
)


def contacts_on(outline: Array, count: int, seed: int, noise: float = 1.0) -> PlanarContacts:
    points, normals = contacts_on_polygon(outline, count, seed, noise)
    return PlanarContacts.of(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)


def lens() -> Array:
    """Two arcs of 50 mm that meet at 37 degrees from the lens's own line."""
    angle = np.linspace(-0.65, 0.65, 120)
    upper = 0.05 * np.column_stack([np.sin(angle), np.cos(angle) - np.cos(0.65)])
    return np.vstack([upper[::-1], -upper[::-1]])


@pytest.mark.parametrize("seed", range(4))
def test_a_half_disc_has_a_straight_and_a_round_side(seed: int) -> None:
    found = RoundedOutline.of(contacts_on(half_disc(), 40, seed), half_disc())
    assert sorted(side.is_round for side in found.sides) == [False, True]
    (round_side,) = (side for side in found.sides if side.is_round)
    assert round_side.radius_m == pytest.approx(0.035, abs=0.002)
    assert contour_errors(found.contour().points_m, half_disc()).hausdorff_m < 0.003


def test_a_lens_has_two_round_sides_that_meet_in_corners() -> None:
    found = RoundedOutline.of(contacts_on(lens(), 40, 3), lens())
    assert [side.is_round for side in found.sides] == [True, True]
    assert contour_errors(found.contour().points_m, lens()).hausdorff_m < 0.003


def test_a_disc_is_one_round_side() -> None:
    circle = ellipse(0.03, 0.03)
    found = RoundedOutline.of(contacts_on(circle, 30, 1), circle)
    assert len(found.sides) == 1
    assert found.sides[0].radius_m == pytest.approx(0.03, abs=0.001)
    assert np.allclose(np.linalg.norm(found.contour().points_m, axis=1), 0.03, atol=0.0015)


def test_where_nothing_is_round_faces_are_left_to_describe_it() -> None:
    with pytest.raises(ShapeError, match="no side is round"):
        RoundedOutline.of(contacts_on(rectangle(), 40, 2), rectangle())


def test_contacts_on_one_straight_side_enclose_nothing() -> None:
    points = np.column_stack([np.linspace(-0.02, 0.02, 8), np.zeros(8)])
    contacts = PlanarContacts.of(points, np.tile([0.0, 1.0], (8, 1)), POINT_SIGMA_m, NORMAL_SIGMA_rad)
    with pytest.raises(ShapeError):
        RoundedOutline.of(contacts, rectangle())


def test_contacts_at_one_place_have_a_side_too() -> None:
    points, normals = np.tile([0.03, 0.01], (6, 1)), np.tile([1.0, 0.0], (6, 1))
    (side,) = divide_into_sides(PlanarContacts.of(points, normals, 1e-3, 0.1), np.arange(6))
    assert not side.is_round
    assert np.allclose(side.values_m(points), 0.0, atol=1e-9)


@settings(deadline=None, max_examples=40)
@given(
    radius_m=st.floats(0.01, 0.2),
    centre_m=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    from_rad=st.floats(-3.0, 3.0),
    concave=st.booleans(),
)
def test_exact_contacts_on_an_arc_give_its_circle(
    radius_m: float, centre_m: tuple[float, float], from_rad: float, concave: bool
) -> None:
    angle = from_rad + np.linspace(0.0, 1.5, 9)
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.array(centre_m) + radius_m * outward
    normals, order = (-outward, np.arange(9)[::-1]) if concave else (outward, np.arange(9))
    (side,) = divide_into_sides(PlanarContacts.of(points, normals, 1e-4, 0.01), order)
    assert side.radius_m == pytest.approx(radius_m, rel=1e-4)
    assert np.sign(side.numbers[0]) == (-1 if concave else 1)
    assert np.allclose(side.centre_m, centre_m, atol=1e-5)
    assert np.allclose(side.gradients(points), normals, atol=1e-4)
    assert np.allclose(side.feet_m(points + 0.001 * normals), points, atol=1e-6)
    assert np.allclose(side.values_m(points + 1e-5 * normals), 1e-5, atol=1e-6)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), count=st.integers(3, 24), spread_m=st.sampled_from([0.0, 1e-4, 0.01, 0.05]))
def test_contacts_anywhere_give_a_finite_outline_or_none(seed: int, count: int, spread_m: float) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 2))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    contacts = PlanarContacts.of(spread_m * rng.normal(size=(count, 2)), normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)
    try:
        found = RoundedOutline.of(contacts, rectangle())
    except ShapeError:
        return
    contour = found.contour()
    assert np.isfinite(contour.points_m).all()
    assert np.isfinite(contour.sigma_m).all()
    assert np.isfinite(found.log_evidence)


def test_the_stated_sigma_holds_the_errors_of_a_round_side() -> None:
    inside = []
    for seed in range(40):
        found = RoundedOutline.of(contacts_on(half_disc(), 30, seed), half_disc()).contour(0.002)
        away_m = distances_to_polygon(found.points_m, half_disc())
        inside.append(np.mean(away_m < 2 * found.sigma_m))
    assert 0.85 < np.mean(inside) <= 1.0


@pytest.mark.parametrize(("outline", "name"), [(half_disc(), "rounded"), (ellipse(), "gpis"), (rectangle(), "polygon")])
def test_the_choice_is_by_evidence(outline: Array, name: str) -> None:
    points, normals = contacts_on_polygon(outline, 40, 5)
    field = Gpis.fit(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad).optimise()
    assert best_shape(field).name == name
