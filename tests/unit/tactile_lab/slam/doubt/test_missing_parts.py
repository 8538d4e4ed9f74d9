"""Contacts that agree on something that the model does not have."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.missing_parts import missing_parts
from tactile_lab.slam.doubt.status import status_of
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

ON_BOX_m = [[0.03, 0.0, 0.01], [-0.03, 0.005, 0.0], [0.0, 0.03, 0.0]]
ON_HANDLE_m = [[0.065, 0.002, 0.01], [0.060, -0.004, 0.018]]


def box() -> SurfaceMesh:
    """60 mm wide in all directions, its middle at the origin."""
    mesh = trimesh.creation.box((0.06, 0.06, 0.06)).subdivide_to_size(0.01)
    count = len(mesh.vertices)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    return SurfaceMesh(vertices, faces, np.full(count, 0.001), np.asarray(mesh.vertex_normals), is_closed=True)


def grasp(*points_m: list[float], left_out: frozenset[int] = frozenset()) -> PlacedGrasp:
    points = np.array(points_m)
    normals: Array = points / np.linalg.norm(points, axis=1, keepdims=True)
    contacts = ContactSet(points, normals, np.full(len(points), 0.001), np.full(len(points), 0.087), np.empty((0, 3)))
    return PlacedGrasp(contacts, np.zeros(3), 1e-6 * np.eye(3), np.zeros(3), left_out)


def a_map(*grasps: PlacedGrasp) -> ContactMap:
    return ContactMap(grasps, GpisSettings())


@pytest.mark.parametrize("left_out", [frozenset(), frozenset({3})], ids=["used", "left out"])
def test_two_grasps_that_meet_the_same_handle_are_told_with_its_place(left_out: frozenset[int]) -> None:
    first = grasp(*ON_BOX_m, ON_HANDLE_m[0], left_out=left_out)
    second = grasp(*ON_BOX_m, ON_HANDLE_m[1], left_out=left_out)
    (told,) = missing_parts(a_map(first, grasp(*ON_BOX_m), second), box(), floor_m=-0.03)
    assert told.grasps == (0, 2)
    assert "2 contacts at x 62, y -1 mm of the model and 40 to 48 mm above the table" in told.words
    assert "35 mm outside the model" in told.words
    assert status_of(lost=False, known_share=0.97, doubts=[told]) == "partial"


def test_contacts_of_one_grasp_alone_or_apart_from_each_other_may_be_wrong() -> None:
    alone = a_map(grasp(*ON_BOX_m, [0.045, 0.0, 0.0]), grasp(*ON_BOX_m))
    wrong = frozenset({3})
    apart = a_map(grasp(*ON_BOX_m, ON_HANDLE_m[0], left_out=wrong), grasp(*ON_BOX_m, [-0.06, 0.0, 0.0], left_out=wrong))
    explained = a_map(grasp(*ON_BOX_m), grasp(*ON_BOX_m, [0.037, 0.0, 0.0]), grasp([0.037, 0.001, 0.0], *ON_BOX_m))
    assert [missing_parts(each, box()) for each in (alone, apart, explained)] == [[], [], []]


def test_where_others_are_wrong_two_are_near_each_other_by_chance_and_three_agree() -> None:
    wrong, strays = frozenset({3}), ([-0.06, 0.0, 0.0], [0.0, -0.065, 0.0], [0.0, 0.07, 0.01])
    others = tuple(grasp(*ON_BOX_m, each, left_out=wrong) for each in strays)
    on_handle = [grasp(*ON_BOX_m, each, left_out=wrong) for each in (*ON_HANDLE_m, [0.062, 0.001, 0.014])]
    assert missing_parts(a_map(*on_handle[:2], *others), box()) == []
    assert len(missing_parts(a_map(*on_handle[:2], *others[:2]), box())) == 1
    assert len(missing_parts(a_map(*on_handle, *others), box())) == 1
    assert len(missing_parts(a_map(grasp(*ON_BOX_m, ON_HANDLE_m[0]), on_handle[1], *others), box())) == 1


def test_one_contact_far_outside_that_the_estimate_uses_is_told() -> None:
    (told,) = missing_parts(a_map(grasp(*ON_BOX_m, ON_HANDLE_m[0]), grasp(*ON_BOX_m)), box(), floor_m=-0.03)
    assert "a contact at x 65, y 2 mm of the model and 40 mm above the table lies 35 mm outside" in told.words
    assert told.grasps == (0,)


def test_a_hollow_that_the_model_fills_is_told() -> None:
    (told,) = missing_parts(a_map(grasp(*ON_BOX_m, [0.001, 0.0, 0.01]), grasp(*ON_BOX_m, [0.0, 0.002, 0.01])), box())
    assert "inside the model: a hollow" in told.words
    assert "in the object frame" in told.words
