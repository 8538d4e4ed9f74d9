"""Poses proposed for a grasp by matching its contacts to the whole map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.graph.relocation import RelocationSettings, relocation_candidates
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import deviation
from tests.support.simulated_contacts import true_map


def before(contact_map: ContactMap, index: int) -> ContactMap:
    return replace(contact_map, placed=contact_map.placed[:index])


def near(rows: Array, true: Array) -> Array:
    gaps = deviation(rows, true)
    return np.asarray((np.hypot(gaps[:, 0], gaps[:, 1]) < 0.006) & (np.abs(gaps[:, 2]) < 0.2))


@pytest.mark.parametrize("shape", ["rectangle", "triangle", "L", "hexagon"])
def test_the_true_pose_is_among_the_proposals_wherever_the_hand_was_believed_to_be(shape: str) -> None:
    contact_map = true_map(shape, seed=1, count=14)
    found = [
        near(
            relocation_candidates(before(contact_map, k), contact_map.placed[k].contacts_world).rows, placed.pose
        ).any()
        for k, placed in enumerate(contact_map.placed)
        if k >= 6
    ]
    assert np.mean(found) >= 0.85


def test_a_shape_without_symmetry_has_the_true_pose_first() -> None:
    contact_map = true_map("hexagon", seed=2, count=14)
    first = [
        near(relocation_candidates(before(contact_map, k), contact_map.placed[k].contacts_world).rows[:1], placed.pose)
        for k, placed in enumerate(contact_map.placed)
        if k >= 8
    ]
    assert np.mean(first) >= 0.8


def test_a_rectangle_s_half_turn_is_proposed_as_well() -> None:
    contact_map = true_map("rectangle", seed=1, count=14)
    found = relocation_candidates(before(contact_map, 13), contact_map.placed[13].contacts_world)
    turns = np.abs(deviation(found.rows, contact_map.placed[13].pose)[:, 2])
    assert np.any(turns > np.deg2rad(170.0))


def test_proposals_are_ranked_differ_and_have_covariances() -> None:
    contact_map = true_map("L", seed=3, count=14)
    settings = RelocationSettings(kept=8)
    found = relocation_candidates(before(contact_map, 12), contact_map.placed[12].contacts_world, settings)
    assert 1 < len(found.rows) <= 8
    assert np.all(np.diff(found.scores) >= 0)
    assert np.all(np.linalg.eigvalsh(found.covariances) > 0)
    gaps = np.abs(deviation(found.rows[1:], found.rows[0]))
    assert np.all((gaps > [0.004, 0.004, 0.12]).any(axis=1))


def test_covariances_tell_the_true_errors() -> None:
    values = []
    for seed in range(3):
        contact_map = true_map("hexagon", seed, count=14)
        for k in range(8, 14):
            found = relocation_candidates(before(contact_map, k), contact_map.placed[k].contacts_world)
            hits = np.flatnonzero(near(found.rows, contact_map.placed[k].pose))
            if len(hits):
                gap = deviation(found.rows[hits[0]], contact_map.placed[k].pose)
                values.append(gap @ np.linalg.solve(found.covariances[hits[0]], gap))
    assert len(values) >= 12
    assert 1.0 < np.mean(values) < 8.0  # chi-square with three degrees of freedom


def test_contacts_on_parallel_sides_propose_nothing() -> None:
    contact_map = true_map("rectangle", seed=1, count=14)
    parallel = ContactSet(
        np.array([[0.0, 0.03], [0.01, 0.03], [0.0, -0.03]]),
        np.array([[0.0, 1.0], [0.0, 1.0], [0.0, -1.0]]),
        np.full(3, 1e-3),
        np.full(3, 0.09),
    )
    assert len(relocation_candidates(contact_map, parallel).rows) == 0


def test_no_contacts_propose_nothing() -> None:
    contact_map = true_map("rectangle", seed=1, count=4)
    nothing = contact_map.placed[0].contacts_world.select(np.zeros(0, dtype=np.intp))
    assert len(relocation_candidates(contact_map, nothing).rows) == 0


def test_in_space_heights_must_fit() -> None:
    """The same outline over another stretch of height: contacts of the lower part do not fit the upper one."""
    flat = true_map("L", seed=3, count=14)

    def lifted(contacts: ContactSet, height_m: float) -> ContactSet:
        ones = np.full((len(contacts), 1), 1.0)
        points, normals = np.hstack([contacts.points_m, height_m * ones]), np.hstack([contacts.normals, 0 * ones])
        return ContactSet(points, normals, contacts.point_sigma_m, contacts.normal_sigma_rad)

    raised = replace(
        flat, placed=tuple(replace(one, contacts_world=lifted(one.contacts_world, 0.02)) for one in flat.placed)
    )
    contacts = flat.placed[12].contacts_world
    level = relocation_candidates(before(raised, 12), lifted(contacts, 0.02))
    above = relocation_candidates(before(raised, 12), lifted(contacts, 0.09))
    assert near(level.rows, flat.placed[12].pose).any()
    assert level.scores[0] < above.scores[0]
