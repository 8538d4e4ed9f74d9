"""Numbers of straight runs of contacts, of their division into faces and of shared directions, on fixed problems."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.corners import Corners, at_corners
from tactile_lab.slam.shape.planar.regularity import with_right_angles
from tactile_lab.slam.shape.planar.runs import (
    cheapest_division,
    chi_square_at,
    direction_variance,
    fit_direction,
    most_gained,
    run_costs,
    turn_back,
)
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
from tactile_lab.slam.shape.planar.uncertainty import FaceUncertainty
from tests.support.baseline import assert_baseline
from tests.support.digest import digest
from tests.support.shape_examples import contacts_on_polygon, ellipse, l_block, rectangle

OBLIQUE_m = np.array([[-0.05, -0.03], [0.04, -0.035], [0.055, 0.02], [0.0, 0.04], [-0.045, 0.015]])


def felt(outline_m: Array, count: int, seed: int, noise: float = 1.0) -> PlanarContacts:
    """Contacts, no two of the same standard deviations."""
    points_m, normals = contacts_on_polygon(outline_m, count, seed, noise)
    return PlanarContacts.of(points_m, normals, np.linspace(0.0007, 0.0015, count), np.linspace(0.12, 0.06, count))


def told(faces: Faces) -> dict[str, object]:
    return {
        "labels": faces.labels,
        "directions": faces.directions_rad,
        "offsets": faces.offsets_m,
        "order": faces.order,
        "chi_square": faces.chi_square,
        "groups": faces.direction_groups,
        "regularity": faces.regularity_nats,
    }


def moments(count: int) -> Array:
    """Of faces with some scatter, pulls of all directions and constants."""
    k = np.arange(count)
    pulls = 40 * np.column_stack([np.cos(0.9 * k), np.sin(0.9 * k)])
    return np.column_stack([20 + 3 * k, 5 * np.sin(k), 12 - 0.7 * k, pulls, 80 + k])


def test_directions_of_faces_from_their_moments() -> None:
    """Newton's search from easy and hard starts, its result's chi-square and variance, and turned moments."""
    found = moments(9)
    hard = found * [8.0, 8.0, 0.1, 0.05, 0.05, 1.0]
    angles, hard_angles = (fit_direction(*each[:, :5].T) for each in (found, hard))
    values = {
        "angles": angles,
        "hard angles": hard_angles,
        "no pull": fit_direction(*np.array([3.0, 1.0, 2.0, 0.0, 0.0])),
        "chi_squares": chi_square_at(angles, found),
        "variances": direction_variance(angles, found),
        "one variance": direction_variance(angles[0], found[0]),
        "turned": [turn_back(found[2], turns) for turns in range(-2, 5)],
    }
    assert_baseline("shape/planar/directions", values)


def test_groups_of_faces_that_gain_most_by_one_direction() -> None:
    """Two nearly perpendicular groups among others, fewer or more in a group, and groups that gain nothing."""
    angles = np.array([0.1, 0.95, 0.1 + np.pi / 2 + 0.02, 2.6])
    pulls = 90 * np.column_stack([np.cos(angles), np.sin(angles)])
    found = np.column_stack([[4.0, 5, 6, 7], [0.5, 0.2, -0.3, 0.1], [3.0, 4, 5, 2], pulls, [180.0] * 4])
    best = fit_direction(*found[:, :5].T)
    sizes = [np.array(each, dtype=float) for each in ([1, 1, 1, 1], [3, 1, 2, 1], [1, 4, 1, 2])]
    values = {
        "gains": [most_gained(found, best, each, loners) for each in sizes for loners in (1.0, 3.0, 500.0)],
        "few": [most_gained(found[:k], best[:k], np.ones(k), 3.0) for k in range(4)],
        "vague": most_gained(found * 1e-3, best, np.ones(4), 3.0),
    }
    assert_baseline("shape/planar/most_gained", values)


def test_every_run_of_contacts_as_one_face() -> None:
    """Chi-square, direction and offset of all runs, and the cheapest division for several prices."""
    contacts = felt(OBLIQUE_m, 18, seed=4)
    order = np.argsort(np.arctan2(contacts.points_m[:, 1], contacts.points_m[:, 0]))
    weights = contacts.point_sigma_m[order] ** -2.0, contacts.normal_sigma_rad[order] ** -2.0
    found = run_costs(contacts.points_m[order], contacts.normals[order], *weights)
    values = {
        "runs": [digest(each) for each in found],
        "divisions": [cheapest_division(found[0], price) for price in (0.0, 3.0, 30.0, 3000.0)],
    }
    assert_baseline("shape/planar/run_costs", values)


def test_contacts_divided_into_faces() -> None:
    """An L, an oblique pentagon and an ellipse: order, faces, and the same with right angles; a clockwise outline."""
    values: dict[str, object] = {}
    for name, outline_m, count in (("L", l_block(), 36), ("oblique", OBLIQUE_m, 30), ("round", ellipse(), 26)):
        contacts = felt(outline_m, count, seed=2)
        order = order_along(contacts, 1.05 * outline_m)
        faces = segment(contacts, 1.05 * outline_m)
        values[name] = {
            "order": order,
            "clockwise": order_along(contacts, 1.05 * outline_m[::-1]),
            "divided": told(divide(contacts, order)),
            "faces": told(faces),
            "along faces": order_along_faces(contacts, faces),
            "length": description_length(contacts, faces),
            "regular": told(with_right_angles(contacts, faces)),
        }
    assert_baseline("shape/planar/faces", values)


def test_a_bad_first_order_is_mended() -> None:
    """Contacts ordered along a circle, where those on both sides of a notch are mixed."""
    contacts = felt(l_block(), 48, seed=5)
    circle = 0.02 * np.column_stack([np.cos(np.arange(40) * np.pi / 20), np.sin(np.arange(40) * np.pi / 20)])
    again = felt(OBLIQUE_m, 40, seed=17)
    assert_baseline(
        "shape/planar/mended_order", {"L": told(segment(contacts, circle)), "again": told(segment(again, circle / 2))}
    )


def test_contacts_that_cannot_be_divided() -> None:
    """In space, of another shape, none, without errors; and an outline of two points."""
    flat, contacts = np.zeros((4, 2)), felt(rectangle(), 8, seed=1)
    for points_m, normals in (
        (np.zeros((4, 3)), np.zeros((4, 3))),
        (flat, flat[:3]),
        (flat[:0], flat[:0]),
        (flat[0], flat[0]),
    ):
        with pytest.raises(ShapeError, match="contacts in the plane"):
            PlanarContacts.of(points_m, normals, 0.001, 0.1)
    for sigmas in ((0.0, 0.1), (0.001, 0.0), (0.001, np.array([0.1, 0.1, -0.1, 0.1]))):
        with pytest.raises(ShapeError, match="above zero"):
            PlanarContacts.of(flat, flat, *sigmas)
    with pytest.raises(ShapeError, match="less than three points"):
        segment(contacts, rectangle()[:2])
    assert segment(contacts, rectangle()[:3]).count > 0


def test_prices_and_evidence_of_faces() -> None:
    """For few and many contacts, precise and vague ones: where the prior is no wider than the contacts, it is free."""
    prices = [
        price_of_face(np.full(count, point_m), np.full(count, normal))
        for count in (1, 2, 3, 40)
        for point_m, normal in ((0.001, 0.1), (0.02, 0.3), (0.06, 4.0))
    ]
    some = np.linspace(0.0008, 0.002, 7), np.linspace(0.05, 0.1, 7)
    evidence = [log_evidence(chi_square, count, *some) for chi_square, count in ((0.0, 0), (11.0, 4), (200.0, 1))]
    assert_baseline("shape/planar/prices", {"prices": prices, "evidence": evidence})


def test_contacts_at_corners() -> None:
    """A normal between those of two faces, at rising distance from their corner and turned more and more."""
    contacts = felt(rectangle(), 30, seed=1, noise=0.2)
    faces = segment(contacts, rectangle())
    corner_m, places = rectangle()[2], np.arange(24)
    values: dict[str, object] = {}
    for name, turn, away in (("away", 0.6, 0.0004), ("turned", 0.0, 0.0)):
        angles = turn + (np.pi / 48 * (places - 4) if name == "turned" else 0 * places)
        normals = np.column_stack([np.cos(angles), np.sin(angles)])
        probes = PlanarContacts.of(corner_m + away * places[:, None] * [-1, 0.3], normals, 0.001, 0.08)
        pairs = np.column_stack([np.arange(faces.count), np.roll(np.arange(faces.count), -1)])
        values[name] = Corners.between(faces, pairs).chi_squares(probes)
        leaning = []
        for place in places:
            all_m, all_normals = np.vstack([contacts.points_m, probes.points_m[place]]), [*contacts.normals]
            sigmas = np.append(contacts.point_sigma_m, 0.001), np.append(contacts.normal_sigma_rad, 0.08)
            joined = PlanarContacts.of(all_m, np.vstack([*all_normals, normals[place]]), *sigmas)
            leaning.append(at_corners(joined, segment(joined, rectangle())).tolist())
        values[f"{name}, leaning"] = [[k for k, leans in enumerate(row) if leans] for row in leaning]
    assert_baseline("shape/planar/at_corners", values)


def test_faces_of_few_contacts_may_be_corners() -> None:
    """A small face between two large ones, with one to four contacts far from their corner; few contacts on all."""
    values, corner_m = [], np.array([0.03, 0.04])
    for count in range(1, 5):
        sizes = np.array([6, count, 6, 5])
        angles = np.array([0.0, 0.7, np.pi / 2, np.pi + 0.4])
        labels = np.repeat(np.arange(4), sizes)
        normals = np.column_stack([np.cos(angles), np.sin(angles)])[labels]
        along = np.linspace(-0.002, 0.003, len(labels))[:, None] * normals[:, ::-1] * [-1, 1]
        for away_m in (-0.002, 0.0, 0.0015):
            offsets_m = np.array([0.03, corner_m @ [np.cos(0.7), np.sin(0.7)] + away_m, 0.04, 0.03])
            faces = Faces(labels, angles, offsets_m, np.arange(len(labels)), 0.0, np.arange(4))
            points_m = np.where(labels[:, None] == 1, corner_m + away_m * normals, offsets_m[labels, None] * normals)
            values.append(np.flatnonzero(at_corners(PlanarContacts.of(points_m + along, normals, 0.001, 0.08), faces)))
    no_corner = Corners(np.empty((0, 2)), np.empty(0), np.empty(0)).chi_squares(felt(rectangle(), 3, seed=1))
    assert_baseline("shape/planar/few_on_faces", {"leaning": values, "none": no_corner})


def test_which_faces_have_a_corner_between() -> None:
    """Pairs of faces turned against each other by ever more: too flat, convex, folded, concave."""
    turns = np.deg2rad(np.arange(-170.0, 180.0, 7.0))
    count = len(turns) + 1
    directions = np.append(0.3, 0.3 + turns)
    faces = Faces(np.arange(count), directions, np.linspace(0.03, 0.05, count), np.arange(count), 0.0, np.arange(count))
    pairs = np.column_stack([np.zeros(count - 1, dtype=np.int64), np.arange(1, count)])
    found = Corners.between(faces, pairs)
    lonely = at_corners(felt(rectangle(), count, seed=0), faces)
    values = {"places": found.places_m, "directions": found.directions_rad, "turns": found.turns_rad, "lonely": lonely}
    assert_baseline("shape/planar/corners_between", values)


def test_uncertainty_of_faces() -> None:
    """Variances and covariances of the faces of an L, whose directions are shared."""
    contacts = felt(l_block(), 36, seed=2)
    faces = with_right_angles(contacts, segment(contacts, l_block()))
    found = FaceUncertainty.of(contacts, faces).scale(1.3)
    places_m = np.column_stack([np.linspace(-0.04, 0.06, 5), np.linspace(0.03, -0.05, 5)])
    values = {
        "middles": found.middles_m,
        "offsets": found.offset_variances_m2,
        "directions": found.direction_variances,
        "covariance": [found.covariance(face) for face in range(faces.count)],
        "variances": [found.variance_m2(face, places_m) for face in range(faces.count)],
    }
    assert_baseline("shape/planar/uncertainty", values, atol=0.0)
