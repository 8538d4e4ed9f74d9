"""Boxes and cylinders whose top was touched all over, or near its edge alone."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from tactile_lab.experiments.data.household import turned
from tactile_lab.slam.doubt.known_part import LARGEST_GUESS_m, known_part, with_guesses_told
from tactile_lab.slam.doubt.status import status_of
from tactile_lab.slam.doubt.unfelt_top import doubts_of_top, unfelt_top
from tactile_lab.slam.shape.surfaces.surface import Mask, SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

WIDE_m, HIGH_m = 0.080, 0.060
UP = np.array([0.0, 0.0, 1.0])


def surface(body: trimesh.Trimesh) -> SurfaceMesh:
    """Standing on the height 0."""
    mesh = body.subdivide_to_size(0.004)
    mesh.merge_vertices()
    vertices = np.asarray(mesh.vertices) - [0.0, 0.0, mesh.bounds[0, 2]]
    corners = vertices[np.asarray(mesh.faces)]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    np.add.at(normals, np.asarray(mesh.faces).ravel(), np.repeat(across, 3, axis=0))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sigma_m = np.full(len(vertices), 0.0005)
    return SurfaceMesh(vertices, np.asarray(mesh.faces, dtype=np.int64), sigma_m, normals, is_closed=True)


def box(width_m: float = WIDE_m) -> SurfaceMesh:
    return surface(trimesh.creation.box((WIDE_m, width_m, HIGH_m)))


def unfelt_of(mesh: SurfaceMesh, points_m: Array, normals: Array) -> Mask:
    """Where all of the surface would count as touched."""
    return unfelt_top(mesh, points_m, normals, np.ones(len(mesh.vertices), dtype=bool))


def on_top(*places_m: tuple[float, float]) -> tuple[Array, Array]:
    """Contacts on the top, and their normals."""
    points_m = np.array([(x, y, HIGH_m) for x, y in places_m])
    return points_m, np.tile(UP, (len(points_m), 1))


def ring(reach_m: float, count: int = 12) -> list[tuple[float, float]]:
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return [(float(reach_m * np.cos(a)), float(reach_m * np.sin(a))) for a in angles]


RIM = [(x, y) for x in (-0.036, 0.0, 0.036) for y in (-0.036, 0.0, 0.036) if (x, y) != (0.0, 0.0)]


def test_a_top_that_was_touched_on_its_edge_alone_may_be_open_within_a_wall() -> None:
    mesh = box()
    unfelt = unfelt_of(mesh, *on_top(*RIM))
    top = np.isclose(mesh.vertices[:, 2], HIGH_m)
    from_edge_m = WIDE_m / 2 - np.abs(mesh.vertices[:, :2]).max(axis=1)
    assert unfelt[top & (from_edge_m > 0.011)].all()
    assert not unfelt[~top | (from_edge_m < 0.009)].any()


def test_one_contact_in_the_middle_is_on_a_lid() -> None:
    assert not unfelt_of(box(), *on_top(*RIM, (0.004, -0.006))).any()


def test_a_top_tapped_at_places_20_mm_apart_is_closed() -> None:
    taps = [(x, y) for x in (-0.03, -0.01, 0.01, 0.03) for y in (-0.03, -0.01, 0.01, 0.03)]
    assert not unfelt_of(box(), *on_top(*taps)).any()


def test_what_counts_as_untouched_anyway_is_no_matter() -> None:
    mesh = box()
    nowhere = np.zeros(len(mesh.vertices), dtype=bool)
    assert not unfelt_top(mesh, *on_top(*RIM), nowhere).any()


def test_a_floor_inside_is_no_lid() -> None:
    dish = surface(turned([0, 40, 60, 55, 36, 0], [0, 0, 60, 60, 8, 5]))
    rim_m, up = on_top(*ring(0.057), *ring(0.048))
    assert not unfelt_of(dish, rim_m, up).any()


def test_a_contact_on_a_wall_below_is_no_lid() -> None:
    points_m, normals = on_top(*RIM)
    points_m, normals = np.vstack([points_m, [0.0, 0.0, 0.03]]), np.vstack([normals, [1.0, 0.0, 0.0]])
    assert unfelt_of(box(), points_m, normals).any()


def test_a_lid_over_one_of_two_tops_says_nothing_of_the_other() -> None:
    low = trimesh.creation.box((WIDE_m, WIDE_m, 0.03)).apply_translation((WIDE_m, 0.0, -0.015))
    joined = surface(trimesh.util.concatenate([trimesh.creation.box((WIDE_m, WIDE_m, HIGH_m)), low]))
    rims = [*RIM, (0.0, 0.0)], [(x + WIDE_m, y) for x, y in RIM]
    points_m = np.vstack([on_top(*rims[0])[0], on_top(*rims[1])[0] - [0.0, 0.0, 0.03]])
    unfelt = unfelt_of(joined, points_m, np.tile(UP, (len(points_m), 1)))
    assert unfelt.any()
    assert joined.vertices[unfelt, 2].max() < 0.031


def test_a_top_too_narrow_for_a_finger_inside_a_rim_is_not_asked_for() -> None:
    edges = [(x, y) for x in (-0.03, 0.0, 0.03) for y in (-0.016, 0.016)]
    assert not unfelt_of(box(width_m=0.040), *on_top(*edges)).any()


@pytest.mark.parametrize(("inside", "status"), [([], "partial"), ([(0.0, 0.0)], "complete")])
def test_what_may_be_open_is_a_guess_and_the_estimate_partial(inside: list[tuple[float, float]], status: str) -> None:
    mesh = surface(trimesh.creation.cylinder(0.040, HIGH_m, sections=48))
    top_m, up = on_top(*ring(0.037), *inside)
    out = np.array([(*place, 0.0) for place in ring(1.0)])
    sides = [0.040 * out + [0.0, 0.0, z] for z in (0.015, 0.045)]
    points_m, normals = np.vstack([top_m, *sides]), np.vstack([up, out, out])
    contacts = ContactSet(points_m, normals, np.full(len(points_m), 0.001), np.full(len(points_m), 0.087))
    part = known_part(mesh, contacts, floor_m=0.0)
    told = with_guesses_told(mesh, part)
    middle = (np.linalg.norm(mesh.vertices[:, :2], axis=1) < 0.028) & (mesh.vertices[:, 2] > HIGH_m - 0.001)
    assert told.known is not None
    assert told.known[middle].all() == bool(inside)
    assert told.sigma_m[middle].min() == pytest.approx(0.0005 if inside else LARGEST_GUESS_m)
    doubts = doubts_of_top(mesh, part.unfelt)
    assert status_of(lost=False, known_share=0.95, doubts=doubts) == status
    assert ["55 x 55 mm" in doubt.words for doubt in doubts] == [True] * (not inside)
