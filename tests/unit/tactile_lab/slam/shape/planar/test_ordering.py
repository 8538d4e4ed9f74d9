"""In which order contacts lie along an outline, and what a face costs."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.segmentation import (
    Faces,
    PlanarContacts,
    description_length,
    divide,
    log_evidence,
    order_along,
    order_along_faces,
    price_of_face,
    segment,
)

WALL = np.array([[-0.05, -0.0005], [0.05, -0.0005], [0.05, 0.0005], [-0.05, 0.0005]])
"""One millimetre thick: its two sides are told apart by normals alone."""
ALONG_m = np.array([0.03, 0.01, -0.01, -0.03])


def on_wall(off_m: float = 0.0) -> PlanarContacts:
    """Four contacts on its upper side from right to left, then four below from left to right; points ``off_m`` off."""
    above = np.column_stack([ALONG_m, np.full(4, 0.0005 - off_m)])
    below = np.column_stack([-ALONG_m, np.full(4, -0.0005 + off_m)])
    normals = np.repeat([[0.0, 1.0], [0.0, -1.0]], 4, axis=0)
    return PlanarContacts.of(np.vstack([above, below]), normals, 0.001, 0.1)


def in_turn(order: Array) -> list[int]:
    """The cyclic order, from contact 0 on."""
    return np.roll(order, -int(np.flatnonzero(order == 0)[0])).tolist()


SIDES = Faces(
    labels=np.repeat([0, 1], 4),
    directions_rad=np.array([np.pi / 2, -np.pi / 2]),
    offsets_m=np.array([0.0005, 0.0005]),
    order=np.arange(8),
    chi_square=0.0,
    direction_groups=np.zeros(2, np.int64),
)


@pytest.mark.parametrize("off_m", [0.0, 0.001])
@pytest.mark.parametrize("outline", [WALL, WALL[::-1]])
def test_contacts_on_both_sides_of_a_thin_wall_are_ordered_by_their_normals(off_m: float, outline: Array) -> None:
    """Also where each lies nearer to the other side, by its error."""
    assert in_turn(order_along(on_wall(off_m), outline)) == list(range(8))


@pytest.mark.parametrize(
    ("sigma_m", "sigma_rad", "believed"), [(0.01, 0.1, "normal"), (0.01, 2.0, "place"), (0.001, 0.3, "place")]
)
def test_place_and_normal_count_by_their_standard_deviations(sigma_m: float, sigma_rad: float, believed: str) -> None:
    """The second contact is on the right side, two centimetres up, but its normal is that of the bottom."""
    square = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
    points = np.array([[0.05, 0.0], [0.1, 0.02], [0.1, 0.01], [0.05, 0.1]])
    normals = np.array([[0.0, -1.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    order = order_along(PlanarContacts.of(points, normals, sigma_m, sigma_rad), square)
    assert in_turn(order) == ([0, 1, 2, 3] if believed == "normal" else [0, 2, 1, 3])


@pytest.mark.parametrize("off_m", [0.0, 0.001])
def test_contacts_are_ordered_along_the_faces_they_fit_best(off_m: float) -> None:
    assert in_turn(order_along_faces(on_wall(off_m), SIDES)) == list(range(8))


def test_a_face_ends_where_its_contacts_end() -> None:
    """Of two faces on one line a contact belongs to the one within whose extent it lies."""
    points = np.array([[0.05, 0.0], [0.04, 0.0], [0.02, 0.0], [-0.03, 0.0], [-0.05, 0.0]])
    contacts = PlanarContacts.of(points, np.tile([0.0, 1.0], (5, 1)), 0.001, 0.1)
    labels, upward = np.array([0, 0, 1, 1, 1]), np.full(2, np.pi / 2)
    faces = Faces(labels, upward, np.zeros(2), np.arange(5), 0.0, np.zeros(2, np.int64))
    assert order_along_faces(contacts, faces).tolist() == [0, 1, 2, 3, 4]


def test_faces_have_outward_normals_and_counter_clockwise_tangents() -> None:
    np.testing.assert_allclose(SIDES.normals, [[0, 1], [0, -1]], atol=1e-12)
    np.testing.assert_allclose(SIDES.tangents, [[-1, 0], [1, 0]], atol=1e-12)
    assert SIDES.count == 2
    assert SIDES.members(1).tolist() == [4, 5, 6, 7]


def test_a_face_costs_the_narrowing_of_the_priors_of_its_three_numbers() -> None:
    sigma_m, sigma_rad = np.full(10, 0.001), np.full(10, 0.1)
    narrowing = np.log(0.1 / (np.sqrt(2 * np.pi) * 0.001)) + np.log(2 * np.pi / (np.sqrt(2 * np.pi) * 0.1))
    assert price_of_face(sigma_m, sigma_rad) == pytest.approx(3 * np.log(10) + 2 * narrowing)
    vague = price_of_face(np.full(10, 1.0), np.full(10, 10.0))
    assert vague == pytest.approx(3 * np.log(10))  # what contacts cannot narrow costs nothing
    assert price_of_face(np.array([1.0]), np.array([10.0])) == pytest.approx(3 * np.log(2))


def test_the_evidence_is_the_likelihood_of_all_values_less_half_the_price_of_each_face() -> None:
    sigma_m, sigma_rad = np.array([0.001, 0.002]), np.array([0.1, 0.2])
    price = price_of_face(sigma_m, sigma_rad)
    likelihood = -0.5 * 3.0 - np.sum(np.log(sigma_m * sigma_rad**2)) - 1.5 * 2 * np.log(2 * np.pi)
    assert log_evidence(3.0, 4, sigma_m, sigma_rad) == pytest.approx(likelihood - 0.5 * 4 * price)
    contacts = on_wall()
    faces = divide(contacts, np.arange(8))
    expected = faces.chi_square + 2 * price_of_face(contacts.point_sigma_m, contacts.normal_sigma_rad)
    assert description_length(contacts, faces) == pytest.approx(expected)


def test_exact_contacts_on_two_sides_are_two_faces_without_misfit() -> None:
    faces = segment(on_wall(), WALL)
    assert faces.count == 2
    assert faces.chi_square == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(faces.offsets_m, [0.0005, 0.0005])
    with pytest.raises(ShapeError, match="less than three points"):
        segment(on_wall(), WALL[:2])


def test_one_standard_deviation_serves_all_contacts_and_others_are_refused() -> None:
    contacts = on_wall()
    assert contacts.point_sigma_m.tolist() == [0.001] * 8
    assert len(contacts.select(np.arange(8) < 3)) == 3
    for points, normals, sigma_m, words in (
        (np.zeros((0, 2)), np.zeros((0, 2)), 0.001, "in the plane"),
        (np.zeros((4, 3)), np.zeros((4, 3)), 0.001, "in the plane"),
        (np.zeros((4, 2)), np.zeros((3, 2)), 0.001, "in the plane"),
        (np.zeros((4, 2)), np.ones((4, 2)), 0.0, "above zero"),
    ):
        with pytest.raises(ShapeError, match=words):
            PlanarContacts.of(points, normals, sigma_m, 0.1)
