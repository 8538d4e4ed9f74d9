"""Early grasps of a long session are condensed to some contacts; their poses are kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.evidence.fixed_lag import condense, unfold
from tests.support.simulated_contacts import true_map

REMEMBERED = 6


@pytest.fixture(scope="module")
def long_map() -> ContactMap:
    return true_map("rectangle", seed=1, count=6)


def test_the_last_grasps_stay_as_they_are_and_the_others_become_one(long_map: ContactMap) -> None:
    found = condense(long_map, 2, REMEMBERED)
    assert found.placed[1:] == long_map.placed[-2:]
    assert found.archive == long_map.placed[:-2]
    assert len(found.placed[0].contacts_world) == REMEMBERED
    assert np.array_equal(found.placed[0].pose, long_map.placed[-3].pose)


def test_condensed_contacts_are_contacts_of_the_object(long_map: ContactMap) -> None:
    """The summary lies at the last settled pose; in the object frame its contacts are those of the map."""
    kept = condense(long_map, 2, REMEMBERED).contacts.points_m[:REMEMBERED]
    all_m = long_map.contacts.points_m
    assert np.linalg.norm(kept[:, None] - all_m[None], axis=2).min(axis=1) == pytest.approx(0.0, abs=1e-9)


def test_unfolding_gives_back_every_grasp(long_map: ContactMap) -> None:
    twice = condense(condense(long_map, 4, REMEMBERED), 2, REMEMBERED)
    assert unfold(twice).placed == long_map.placed
    assert unfold(long_map) is long_map


def test_both_sides_of_a_thin_plate_are_remembered(long_map: ContactMap) -> None:
    """Their contacts lie at the same places; only the normals differ."""
    points_m = np.array([[0.0, 0.0], [0.002, 0.0], [0.0, 0.0], [0.002, 0.0]])
    plate = contacts(points_m, np.array([[0.0, 1.0], [0.0, 1.0], [0.0, -1.0], [0.0, -1.0]]))
    found = condense(with_first(long_map, plate), 5, 2)
    assert sorted(found.contacts.normals[:2, 1]) == pytest.approx([-1.0, 1.0])


def test_twice_as_many_free_places_as_contacts_are_remembered(long_map: ContactMap) -> None:
    free_m = np.column_stack([np.linspace(0.1, 0.2, 50), np.zeros(50)])
    points_m = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.05]])
    known = replace(contacts(points_m, np.eye(2)[[0, 1, 0]]), free_m=free_m, free_of=np.full(50, -1))
    found = condense(with_first(long_map, known), 5, 5).placed[0].contacts_world
    assert 5 < len(found.free_m) <= 10
    assert found.free_m[0] == pytest.approx(free_m[0])


def contacts(points_m: Array, normals: Array) -> ContactSet:
    count = len(points_m)
    return ContactSet(points_m, normals, np.full(count, 0.001), np.full(count, 0.1))


def with_first(contact_map: ContactMap, made: ContactSet) -> ContactMap:
    """The map with other contacts in its first grasp, at a pose of zero."""
    first = replace(contact_map.placed[0], contacts_world=made, pose=np.zeros(3), left_out=frozenset())
    return replace(contact_map, placed=(first, *contact_map.placed[1:]))
