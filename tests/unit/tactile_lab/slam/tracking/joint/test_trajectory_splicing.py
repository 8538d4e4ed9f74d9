"""A trajectory that once took a wrong turn is joined anew at that step."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings
from tactile_lab.slam.tracking.joint.trajectory_splicing import splice_trajectories
from tests.support.simulated_contacts import true_map

NOISE, SETTINGS = MotionNoise(translation_m=0.005, rotation_rad=0.15), ProposalSettings()
WRONG_TURN = np.array([0.004, -0.006, 0.9])


@pytest.fixture(scope="module")
def known() -> ContactMap:
    return true_map("triangle", count=10).with_best_kernel()


def turned_from(known: ContactMap, step: int, turn: Array = WRONG_TURN) -> ContactMap:
    """The object frame of all grasps from a step on is another."""
    rows = known.rows.copy()
    rows[step:] = known.space.compose(rows[step:], turn)
    return known.with_rows(rows)


def farthest(one: ContactMap, other: ContactMap) -> tuple[float, float]:
    """Largest distance, m, and turn, rad, between the poses of two trajectories."""
    gaps = np.abs(one.space.deviation(one.rows, other.rows))
    return float(np.linalg.norm(gaps[:, :2], axis=1).max()), float(gaps[:, 2].max())


@pytest.mark.parametrize("step", [3, 5, 8])
def test_the_smaller_half_is_found_its_place_on_the_other(known: ContactMap, step: int) -> None:
    """Also where that is the earlier one: the object frame stays that of the first grasp."""
    spoilt = turned_from(known, step)
    assert farthest(spoilt, known)[1] > 0.8
    found = splice_trajectories(spoilt, NOISE, SETTINGS)
    assert 1 <= len(found) <= 3 * 4
    best_m, best_rad = min(farthest(one, known) for one in found)
    assert best_m < 0.002
    assert best_rad < 0.03
    for one in found:
        np.testing.assert_array_equal(one.rows[0], known.rows[0])


def test_a_trajectory_without_unlikely_steps_is_left_as_it_is(known: ContactMap) -> None:
    wide = MotionNoise(translation_m=0.1, rotation_rad=3.0)
    assert splice_trajectories(turned_from(known, 5), wide, SETTINGS) == []


def test_one_grasp_of_few_contacts_is_no_half(known: ContactMap) -> None:
    far, only_there = turned_from(known, 9, np.array([0.0, 0.0, 3.0])), MotionNoise(translation_m=0.1, rotation_rad=1.3)
    assert splice_trajectories(far, only_there, SETTINGS)
    for contact in range(len(far.placed[9].contacts_world) - 2):
        far = far.without_contact(9, contact)
    assert splice_trajectories(far, only_there, SETTINGS) == []
