"""The map of contacts: what is part of the shape, what is kept aside, and what follows from the poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.contacts import Array, Contact, Grasp
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR

DIRECTIONS = np.deg2rad([0, 90, 180])


def placed(row: Array, left_out: frozenset[int] = frozenset(), moved: Moved = Moved.AS_MEANT) -> PlacedGrasp:
    """Three contacts on a disc of 30 mm that stands at a pose."""
    normals = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS), np.zeros(3)])
    points = 0.03 * normals + [row[0], row[1], 0.0]
    contacts = [
        Contact(finger, point, normal, 1e-6 * np.eye(3), 0.1, 0.5)
        for finger, point, normal in zip(("FF", "MF", "RF"), points, normals, strict=True)
    ]
    world = ContactSet.of_grasp(Grasp(0, 0, tuple(contacts), Pose3()), 2, 0.0)
    return PlacedGrasp(world, row, np.zeros((3, 3)), np.zeros(3), left_out, moved)


@pytest.fixture
def three() -> ContactMap:
    rows = np.array([[0.0, 0.0, 0.0], [0.1, 0.02, 0.0], [-0.05, 0.1, 0.0]])
    aside = (frozenset({1}), frozenset({0, 1, 2}), frozenset[int]())
    return ContactMap(tuple(map(placed, rows, aside)), GpisSettings(), PLANAR)


def test_what_is_kept_aside_is_no_part_of_the_shape(three: ContactMap) -> None:
    assert three.origins == [(0, 0), (0, 2), (2, 0), (2, 1), (2, 2)]
    assert three.grasp_indices.tolist() == [0, 0, 2, 2, 2]
    assert three.left_out_count == 4
    np.testing.assert_allclose(np.linalg.norm(three.contacts.points_m, axis=1), 0.03)


def test_contacts_are_left_out_and_taken_back_one_by_one(three: ContactMap) -> None:
    assert three.without_contact(2, 1).origins == [(0, 0), (0, 2), (2, 0), (2, 2)]
    assert three.with_contact(0, 1).origins[:3] == [(0, 0), (0, 1), (0, 2)]
    assert three.without_contact(2, 1).with_contact(2, 1).origins == three.origins


def test_all_contacts_come_back_but_those_of_grasps_that_have_no_place(three: ContactMap) -> None:
    everything = three.with_all_contacts()
    assert everything.origins == [(0, 0), (0, 1), (0, 2), (2, 0), (2, 1), (2, 2)]
    assert everything.left_out_count == 3


def test_unplaced_grasps_are_counted_from_the_end(three: ContactMap) -> None:
    assert three.trailing_unplaced == 0
    assert three.without_grasp(2).trailing_unplaced == 1
    assert three.with_placed(2, three.placed[2].put_aside()).trailing_unplaced == 2


def test_other_poses_move_what_has_been_gathered(three: ContactMap) -> None:
    before = three.contacts.points_m.copy()
    moved = three.with_rows(three.rows + np.array([0.01, 0.0, 0.0]))
    np.testing.assert_allclose(moved.contacts.points_m, before - [0.01, 0.0], atol=1e-12)
    np.testing.assert_allclose(three.contacts.points_m, before)


def test_a_map_read_backward_keeps_its_own_frame_and_where_the_object_moved_freely(three: ContactMap) -> None:
    forward = three.with_placed(2, placed(three.rows[2], moved=Moved.FREELY))
    turn = np.array([0.3, -0.2, 0.5])
    steps = (Moved.AS_MEANT, Moved.AS_MEANT, Moved.PUSHED)
    backward = ContactMap(
        tuple(
            placed(PLANAR.compose(row, turn), aside.left_out, step)
            for row, aside, step in zip(forward.rows[::-1], forward.placed[::-1], steps, strict=True)
        ),
        GpisSettings(),
        PLANAR,
    )
    reread = forward.reread(backward)
    np.testing.assert_allclose(reread.rows, forward.rows, atol=1e-12)
    assert [each.left_out for each in reread.placed] == [each.left_out for each in forward.placed]
    assert reread.moved == (Moved.AS_MEANT, Moved.PUSHED, Moved.FREELY)


def felt(*touches: tuple[float, float, bool]) -> PlacedGrasp:
    """A grasp with contacts at heights, each with the vertical part of its normal and whether it was probed."""
    contacts = tuple(
        Contact("FF", np.array([0.0, 0.0, z]), np.array([np.sqrt(1 - up**2), 0.0, up]), probed=probed)
        for z, up, probed in touches
    )
    world = ContactSet.of_grasp(Grasp(0, 0, contacts), 3, 0.02)
    return PlacedGrasp(world, np.zeros(3), np.eye(3), np.zeros(3))


def test_nothing_is_over_a_top_that_was_tapped() -> None:
    settings = GpisSettings()
    tapped = felt((0.100, 1.0, True), (0.040, 0.0, False))
    higher = felt((0.104, 0.9, False))
    assert ContactMap((tapped,), settings).top_m == pytest.approx(0.083)
    assert ContactMap((tapped, higher), settings).top_m == pytest.approx(0.087)
    assert ContactMap((tapped.put_aside(), felt((0.05, 0.0, False))), settings).top_m is None, "it has no place"
    without_it = replace(tapped, left_out=frozenset({0}))
    assert ContactMap((without_it,), settings).top_m == pytest.approx(0.083), "the finger was there all the same"


def test_where_the_top_was_not_looked_for_nothing_is_known_of_it() -> None:
    settings = GpisSettings()
    assert ContactMap((felt((0.100, 1.0, False)),), settings).top_m is None
    assert ContactMap((felt((0.100, 0.0, True)),), settings).top_m is None, "a side was probed"
    assert ContactMap((felt((0.060, 1.0, True), (0.100, 0.0, False)),), settings).top_m is None, "a lower part"
