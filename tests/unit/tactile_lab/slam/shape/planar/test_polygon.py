"""The facet model in the plane: exact where contacts are, invariant, simple, with stated errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.metrics.metrics import contour_errors
from tactile_lab.slam.shape.planar.outlines import encloses, is_simple
from tactile_lab.slam.shape.planar.polygon import BRIDGE, Polygon
from tactile_lab.slam.shape.planar.regularity import with_right_angles
from tactile_lab.slam.shape.planar.segmentation import (
    Faces,
    PlanarContacts,
    divide,
    log_evidence,
    segment,
)
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon, polygon_area
from tactile_lab.slam.shape.surfaces.surface import extract_contour
from tests.support.shape_examples import (
    NORMAL_SIGMA_rad,
    POINT_SIGMA_m,
    contacts_on_polygon,
    ellipse,
    l_block,
    rectangle,
    triangle,
)

OUTLINES = {"rectangle": rectangle(), "triangle": triangle(), "L": l_block()}


def contacts_on(outline: Array, count: int, seed: int, noise: float = 1.0) -> PlanarContacts:
    points, normals = contacts_on_polygon(outline, count, seed, noise)
    return PlanarContacts.of(points, normals, POINT_SIGMA_m, NORMAL_SIGMA_rad)


def faces_of(contacts: PlanarContacts, outline: Array) -> Faces:
    return segment(contacts, outline_rounded(outline))


def outline_rounded(outline: Array) -> Array:
    """A provisional outline: the corners cut off."""
    after = np.roll(outline, -1, axis=0)
    return np.stack([0.85 * outline + 0.15 * after, 0.15 * outline + 0.85 * after], axis=1).reshape(-1, 2)


def partition(labels: Array) -> set[frozenset[int]]:
    return {frozenset(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels)}


@pytest.mark.parametrize("name", OUTLINES)
def test_noise_free_contacts_give_the_outline_exactly(name: str) -> None:
    outline = OUTLINES[name]
    contacts = contacts_on(outline, 40, seed=1, noise=0.0)
    polygon = Polygon.of(contacts, faces_of(contacts, outline))
    assert len(polygon.corners_m) == len(outline)
    assert contour_errors(polygon.outline_m, outline).hausdorff_m < 1e-9


@pytest.mark.parametrize("name", OUTLINES)
def test_noisy_contacts_give_the_right_number_of_faces_and_sharp_corners(name: str) -> None:
    outline = OUTLINES[name]
    errors = []
    for seed in range(5):
        contacts = contacts_on(outline, 40, seed)
        faces = faces_of(contacts, outline)
        assert faces.count == len(outline)
        errors.append(contour_errors(Polygon.of(contacts, faces).outline_m, outline).hausdorff_m)
    assert np.mean(errors) < 0.003


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.floats(-3.1, 3.1), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(0, 39))
def test_division_does_not_depend_on_place_turn_or_first_contact(angle: float, x: float, y: float, shift: int) -> None:
    outline = l_block()
    contacts = contacts_on(outline, 40, seed=3)
    faces = faces_of(contacts, outline)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = PlanarContacts.of(
        np.roll(contacts.points_m @ turn.T + [x, y], shift, axis=0),
        np.roll(contacts.normals @ turn.T, shift, axis=0),
        POINT_SIGMA_m,
        NORMAL_SIGMA_rad,
    )
    again = faces_of(moved, outline @ turn.T + [x, y])
    assert partition(np.roll(again.labels, -shift)) == partition(faces.labels)
    assert again.chi_square == pytest.approx(faces.chi_square, abs=1e-6)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.integers(0, 39))
def test_division_of_a_cyclic_order_does_not_depend_on_where_it_begins(shift: int) -> None:
    contacts = contacts_on(rectangle(), 40, seed=4)
    order = faces_of(contacts, rectangle()).order
    assert partition(divide(contacts, np.roll(order, shift)).labels) == partition(divide(contacts, order).labels)


def test_direction_of_turning_of_the_provisional_outline_does_not_matter() -> None:
    contacts = contacts_on(triangle(), 40, seed=5)
    assert partition(faces_of(contacts, triangle()[::-1]).labels) == partition(faces_of(contacts, triangle()).labels)


def test_faces_are_numbered_counter_clockwise_along_the_order() -> None:
    contacts = contacts_on(rectangle(), 40, seed=6)
    faces = faces_of(contacts, rectangle())
    assert (np.diff(faces.labels[faces.order]) >= 0).all()
    turns = np.diff(np.append(faces.directions_rad, faces.directions_rad[0]))
    assert np.angle(np.exp(1j * turns)) == pytest.approx(np.full(4, np.pi / 2), abs=0.1)


def test_evidence_is_that_of_the_contacts_less_the_price_of_faces() -> None:
    one = log_evidence(10.0, 4, np.full(40, 0.001), np.full(40, 0.1))
    assert log_evidence(12.0, 4, np.full(40, 0.001), np.full(40, 0.1)) == pytest.approx(one - 1.0)
    assert log_evidence(10.0, 5, np.full(40, 0.001), np.full(40, 0.1)) < one - 0.5 * 3 * np.log(40)


def test_right_angles_make_a_rectangle_better_and_leave_a_triangle_alone() -> None:
    plain, regular = [], []
    for seed in range(8):
        contacts = contacts_on(rectangle(), 40, seed)
        faces = faces_of(contacts, rectangle())
        tied = with_right_angles(contacts, faces)
        assert np.unique(tied.direction_groups).size == 1
        assert tied.chi_square >= faces.chi_square
        plain.append(contour_errors(Polygon.of(contacts, faces).outline_m, rectangle()).hausdorff_m)
        regular.append(contour_errors(Polygon.of(contacts, tied).outline_m, rectangle()).hausdorff_m)
    assert np.mean(regular) < 0.75 * np.mean(plain)
    contacts = contacts_on(triangle(), 40, seed=0)
    faces = faces_of(contacts, triangle())
    assert with_right_angles(contacts, faces).directions_rad == pytest.approx(faces.directions_rad, abs=1e-6)


def test_angles_that_need_not_be_known_count_in_the_evidence() -> None:
    for seed in range(8):
        contacts = contacts_on(rectangle(), 40, seed)
        free = faces_of(contacts, rectangle())
        tied = with_right_angles(contacts, free)
        gained = Polygon.of(contacts, tied).log_evidence - Polygon.of(contacts, free).log_evidence
        assert free.regularity_nats == 0.0
        assert gained == pytest.approx(tied.regularity_nats - 0.5 * (tied.chi_square - free.chi_square))
        assert gained > 3 * np.log(2)  # three angles, each far better known than to a quarter turn
    contacts = contacts_on(triangle(), 40, seed=0)
    assert with_right_angles(contacts, faces_of(contacts, triangle())).regularity_nats == pytest.approx(0.0, abs=1e-9)


def test_stated_sigmas_cover_the_error_of_faces() -> None:
    covered = []
    for seed in range(20):
        contacts = contacts_on(triangle(), 40, seed)
        polygon = Polygon.of(contacts, faces_of(contacts, triangle()))
        contour = polygon.contour()
        covered.append(np.mean(distances_to_polygon(contour.points_m, triangle()) < 2 * contour.sigma_m))
    assert 0.90 < np.mean(covered) < 0.99


def test_contour_holds_the_corners_and_turns_counter_clockwise() -> None:
    contacts = contacts_on(l_block(), 60, seed=2)
    polygon = Polygon.of(contacts, faces_of(contacts, l_block()))
    contour = polygon.contour(0.002)
    assert polygon_area(contour.points_m) == pytest.approx(polygon_area(polygon.outline_m))
    assert np.linalg.norm(np.diff(contour.points_m, axis=0), axis=1).max() <= 0.002 + 1e-9
    assert len(contour.points_m) == len(contour.sigma_m)


def test_a_side_that_nothing_touched_is_bridged_with_large_sigma() -> None:
    contacts = contacts_on(rectangle(), 60, seed=2)
    seen = contacts.normals[:, 0] < 0.5
    contacts = PlanarContacts.of(contacts.points_m[seen], contacts.normals[seen], POINT_SIGMA_m, NORMAL_SIGMA_rad)
    polygon = Polygon.of(contacts, faces_of(contacts, rectangle()))
    assert (polygon.edge_faces == BRIDGE).any()
    assert len(polygon.corners_m) == 2
    contour = polygon.contour()
    assert contour.sigma_m.max() > 0.010
    assert is_simple(polygon.outline_m)


def test_gaps_are_bridged_by_the_provisional_outline() -> None:
    points, normals = contacts_on_polygon(rectangle(), 60, seed=2)
    seen = normals[:, 0] < 0.5
    field = Gpis.fit(points[seen], normals[seen]).optimise()
    provisional = extract_contour(field)
    contacts = PlanarContacts.of(points[seen], normals[seen], POINT_SIGMA_m, NORMAL_SIGMA_rad)
    faces = segment(contacts, provisional.points_m)
    polygon = Polygon.of(contacts, faces, provisional)
    bridge = polygon.outline_m[polygon.edge_faces == BRIDGE]
    assert len(bridge) > 20
    assert np.median(distances_to_polygon(bridge, provisional.points_m)) < 1e-9


def test_contacts_on_two_sides_make_no_polygon() -> None:
    contacts = contacts_on(rectangle(), 40, seed=1)
    seen = np.abs(contacts.normals[:, 0]) < 0.5
    contacts = PlanarContacts.of(contacts.points_m[seen], contacts.normals[seen], 0.001, 0.1)
    with pytest.raises(ShapeError, match="enclose nothing"):
        Polygon.of(contacts, faces_of(contacts, rectangle()))


def test_contacts_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ShapeError, match="in the plane"):
        PlanarContacts.of(np.zeros((4, 3)), np.zeros((4, 3)), 0.001, 0.1)
    with pytest.raises(ShapeError, match="above zero"):
        PlanarContacts.of(np.zeros((4, 2)), np.zeros((4, 2)), 0.0, 0.1)
    with pytest.raises(ShapeError, match="less than three"):
        segment(PlanarContacts.of(np.zeros((4, 2)), np.ones((4, 2)), 0.001, 0.1), np.zeros((2, 2)))


def test_every_outline_is_simple_even_from_few_contacts_on_a_curve() -> None:
    for seed in range(20):
        contacts = contacts_on(ellipse(), 12, seed)
        try:
            polygon = Polygon.of(contacts, faces_of(contacts, ellipse()))
        except ShapeError:
            continue
        assert is_simple(polygon.outline_m)
        assert polygon_area(polygon.outline_m) > 0


def test_simple_outlines_are_told_from_crossed_ones() -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    assert is_simple(square)
    assert not is_simple(square[[0, 2, 1, 3]])
    assert not is_simple(np.array([[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]], dtype=float))
    assert not is_simple(np.array([[0, 0], [2, 0], [1, 0], [1, 1]], dtype=float))


def test_inside_and_outside_of_an_outline() -> None:
    inside = encloses(l_block(), np.array([[0.0, 0.0], [0.05, 0.04], [-0.02, 0.04], [0.2, 0.0]]))
    assert inside.tolist() == [True, False, True, False]
