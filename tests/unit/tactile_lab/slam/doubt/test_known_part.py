"""How much of a shape was touched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from tactile_lab.experiments.data.household import turned
from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.slam.doubt.known_part import LARGEST_GUESS_m, known_part, reach_for, with_guesses_told
from tactile_lab.slam.shape.surfaces.sampling import sample_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

SQUARE_m = sample_polygon(1e-3 * np.array([[-45.0, -45.0], [45.0, -45.0], [45.0, 45.0], [-45.0, 45.0]]), 0.001)
RIGHT, LEFT, TOP = ((np.array(normal), np.array(middle)) for normal, middle in (
    ((1.0, 0.0), (0.045, 0.0)), ((-1.0, 0.0), (-0.045, 0.0)), ((0.0, 1.0), (0.0, 0.045))
))  # fmt: skip


def outline(sigma_m: float = 0.001) -> Contour:
    return Contour(SQUARE_m, np.full(len(SQUARE_m), sigma_m), is_closed=True)


def touched(*faces: tuple[Array, Array]) -> ContactSet:
    along = np.linspace(-0.04, 0.04, 6)
    points = [middle + step * np.array([-normal[1], normal[0]]) for normal, middle in faces for step in along]
    normals = [normal for normal, _ in faces for _ in along]
    count = len(points)
    return ContactSet(np.array(points), np.array(normals), np.full(count, 0.001), np.full(count, 0.087))


@pytest.mark.parametrize(
    ("faces", "share"), [((RIGHT,), 0.25), ((RIGHT, LEFT), 0.5), ((RIGHT, TOP), 0.5), ((RIGHT, LEFT, TOP), 0.75)]
)
def test_a_contact_tells_of_its_own_face_only(faces: tuple[tuple[Array, Array], ...], share: float) -> None:
    assert known_part(outline(), touched(*faces)).share == pytest.approx(share, abs=0.03)


def test_the_tip_of_a_wedge_is_known_from_both_its_faces() -> None:
    wedge = sample_polygon(1e-3 * np.array([[0.0, 0.0], [60.0, -15.0], [60.0, 15.0]]), 0.001)
    normals = np.array([[-15.0, -60.0], [-15.0, 60.0]]) / np.hypot(15.0, 60.0)
    points = 1e-3 * np.array([[20.0, -5.0], [20.0, 5.0]])
    contacts = ContactSet(points, normals, np.full(2, 0.001), np.full(2, 0.087))
    part = known_part(Contour(wedge, np.full(len(wedge), 0.001), is_closed=True), contacts)
    assert part.known[np.linalg.norm(wedge, axis=1).argmin()]


@pytest.mark.parametrize(
    ("longest_m", "grasps", "reach_m"),
    [(0.09, 8, 0.025), (0.15, 3, 0.025), (0.18, 8, 0.030), (0.40, 8, LARGEST_GUESS_m), (0.40, 2, 0.010)],
)
def test_large_objects_are_known_farther_from_contacts(longest_m: float, grasps: int, reach_m: float) -> None:
    far_apart = touched(RIGHT, LEFT)
    far_apart = replace(far_apart, points_m=far_apart.points_m * [longest_m / 0.09, 1.0])
    assert reach_for(far_apart, grasps) == pytest.approx(reach_m)


def test_nothing_is_known_without_contacts_or_where_the_shape_is_uncertain() -> None:
    nothing = ContactSet(np.empty((0, 2)), np.empty((0, 2)), np.empty(0), np.empty(0))
    assert known_part(outline(), nothing).share == 0.0
    assert known_part(outline(sigma_m=0.006), touched(RIGHT, LEFT, TOP)).share == 0.0


def test_a_guess_is_marked_and_has_no_small_sigma() -> None:
    part = known_part(outline(), touched(RIGHT))
    told = with_guesses_told(outline(), part)
    assert told.known is not None
    assert told.sigma_m[~told.known].min() == LARGEST_GUESS_m
    np.testing.assert_array_equal(told.sigma_m[told.known], 0.001)


def test_what_is_uncertain_near_contacts_is_no_guess_farther_than_it_says() -> None:
    unsure = outline(sigma_m=0.006)
    part = known_part(unsure, touched(RIGHT))
    told = with_guesses_told(unsure, part)
    assert not part.known.any()
    np.testing.assert_array_equal(told.sigma_m[part.near], 0.006)
    assert told.sigma_m[~part.near].min() == LARGEST_GUESS_m


def test_simulated_grasps_all_around_know_the_whole_outline() -> None:
    ellipse = OUTLINES_m["ellipse"]
    normals = ellipse * [1.0, 25.0 / 9.0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    every = slice(None, None, 12)
    count = len(ellipse[every])
    contacts = ContactSet(ellipse[every], normals[every], np.full(count, 0.001), np.full(count, 0.087))
    shape = Contour(ellipse, np.full(len(ellipse), 0.001), is_closed=True)
    assert known_part(shape, contacts).share > 0.95


def faceted(mesh: trimesh.Trimesh) -> SurfaceMesh:
    """Each face with vertices and normals of its own."""
    normals, count = np.repeat(np.asarray(mesh.face_normals), 3, axis=0), 3 * len(mesh.faces)
    corners = np.asarray(mesh.triangles).reshape(-1, 3)
    return SurfaceMesh(corners, np.arange(count).reshape(-1, 3), np.full(count, 0.001), normals, is_closed=True)


def test_a_surface_that_goes_on_by_symmetry_is_known_only_near_contacts() -> None:
    tin = faceted(trimesh.creation.cylinder(0.04, 0.10, sections=64).subdivide_to_size(0.01))
    angles = np.radians([0.0, 120.0, 240.0])
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    contacts = ContactSet(0.04 * around, around, np.full(3, 0.001), np.full(3, 0.087))
    three = known_part(tin, contacts, floor_m=-0.05).share
    every = np.radians(np.arange(0.0, 360.0, 45.0))
    ring = np.column_stack([np.cos(every), np.sin(every), np.zeros(8)])
    low_and_high = np.concatenate([0.04 * ring + [0, 0, height] for height in (-0.025, 0.025)])
    all_around = ContactSet(low_and_high, np.tile(ring, (2, 1)), np.full(16, 0.001), np.full(16, 0.087))
    assert three < 0.4
    assert known_part(tin, all_around, floor_m=-0.05).share > three + 0.3


def test_the_inside_of_a_wall_is_known_where_its_outside_was_touched() -> None:
    cup = faceted(turned([0, 36, 36, 31, 31, 0], [0, 0, 80, 80, 5, 5]).subdivide_to_size(0.006))
    outward = np.einsum("nk,nk->n", cup.normals, cup.vertices * [1.0, 1.0, 0.0])
    lining = (outward < -0.01) & (cup.vertices[:, 2] > 0.04)
    angles = np.radians([-40.0, -20.0, 0.0, 20.0, 40.0])
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(5)])
    places_m = np.concatenate([0.036 * around + [0.0, 0.0, height_m] for height_m in (0.05, 0.07)])
    contacts = ContactSet(places_m, np.tile(around, (2, 1)), np.full(10, 0.001), np.full(10, 0.087))
    assert not known_part(cup, contacts, floor_m=0.0).known[outward < -0.01].any()
    known = known_part(replace(cup, lining=lining), contacts, floor_m=0.0).known
    assert not known[(outward < -0.01) & ~lining].any()
    beside = lining & (cup.vertices[:, 0] > 0.025)
    assert known[beside].all()
    assert not known[lining & (cup.vertices[:, 0] < -0.01)].any()


def test_what_a_finger_went_through_is_not_known() -> None:
    box = faceted(trimesh.creation.box((0.06, 0.06, 0.06)).subdivide_to_size(0.005))
    normals = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    contacts = ContactSet(0.03 * normals, normals, np.full(6, 0.001), np.full(6, 0.087))
    inside, outside = np.array([[0.022, 0.0, 0.0]]), np.array([[0.045, 0.0, 0.0], [0.029, 0.0, 0.0]])
    whole = known_part(box, contacts)
    assert known_part(box, contacts, free_m=outside).share == whole.share
    part = known_part(box, contacts, free_m=inside)
    away = np.linalg.norm(box.vertices - [0.03, 0.0, 0.0], axis=1)
    assert not part.known[away < 0.008].any()
    assert (part.known == whole.known)[away > 0.012].all()


def test_a_standing_box_is_known_below_from_the_table_and_not_above() -> None:
    box = trimesh.creation.box((0.06, 0.06, 0.06)).subdivide_to_size(0.01)
    normals = np.asarray(box.face_normals)
    mesh = SurfaceMesh(
        np.asarray(box.triangles).reshape(-1, 3),
        np.arange(3 * len(box.faces)).reshape(-1, 3),
        np.full(3 * len(box.faces), 0.001),
        np.repeat(normals, 3, axis=0),
        is_closed=True,
    )
    sides = np.repeat([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], 4, axis=0)
    spread = np.tile([[0.015, 0.015], [0.015, -0.015], [-0.015, 0.015], [-0.015, -0.015]], (4, 1))
    along = np.column_stack([-sides[:, 1], sides[:, 0], np.zeros(16)])
    points = 0.03 * sides + spread[:, :1] * along + spread[:, 1:] * [0, 0, 1]
    contacts = ContactSet(points, sides, np.full(16, 0.001), np.full(16, 0.087))
    assert known_part(mesh, contacts, floor_m=-0.03).share == pytest.approx(5 / 6, abs=0.05)
    assert known_part(mesh, contacts).share == pytest.approx(4 / 6, abs=0.05)
