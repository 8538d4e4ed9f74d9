"""Contacts between the corners of an outline's faces."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.faces.face_extents import between_ends, overhang

NORMALS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
OFFSETS_m = np.array([0.05, 0.03, 0.05, 0.03])
LABELS = np.array([0, 1, 1, 3])
POINTS_m = np.array([[0.05, 0.01], [0.058, 0.03], [-0.051, 0.03], [0.02, -0.03]])


def test_contacts_beyond_a_corner_are_drawn_back_along_their_face() -> None:
    found = overhang(POINTS_m, LABELS, NORMALS, OFFSETS_m)
    assert np.allclose(found.beyond_m, [0, 0.008, 0.001, 0])
    assert np.allclose(found.ways, [[0, 0], [1, 0], [-1, 0], [0, 0]])


def test_overhang_follows_the_offsets_of_both_faces_at_a_corner() -> None:
    turned = np.array([[np.cos(a), np.sin(a)] for a in (0.1, 1.4, 3.3, 4.9)])

    def beyond_m(offsets_m: Array) -> Array:
        return overhang(POINTS_m, LABELS, turned, offsets_m).beyond_m

    found, step = overhang(POINTS_m, LABELS, turned, OFFSETS_m).by_offsets, 1e-6
    assert beyond_m(OFFSETS_m).max() > 0.005
    for face in range(4):
        change = step * (np.arange(4) == face)
        assert np.allclose(found[:, face], (beyond_m(OFFSETS_m + change) - beyond_m(OFFSETS_m)) / step, atol=1e-6)


def test_a_contact_far_beyond_a_corner_tells_that_the_corner_is_wrong() -> None:
    held = between_ends(POINTS_m, LABELS, NORMALS, OFFSETS_m, np.full(4, 0.001))
    assert held.tolist() == [True, False, True, True]


def test_nearly_flat_faces_do_not_end_at_each_other() -> None:
    normals = np.array([[1.0, 0.0], [np.cos(0.2), np.sin(0.2)], [-1.0, 0.0]])
    found = overhang(np.array([[0.05, 0.04]]), np.array([0]), normals, np.full(3, 0.05))
    assert found.beyond_m.tolist() == [0.0]
