"""The beginning of one reading of a session is joined with the end of another, where each is right."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.joint.crossed_readings import crossed_readings, join_at
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer
from tactile_lab.slam.tracking.joint.proposals import UNEXPLAINED_COST, ProposalSettings
from tests.support.simulated_contacts import true_map

NOISE, SETTINGS = MotionNoise(translation_m=0.005, rotation_rad=0.15), ProposalSettings()
SCORER = HypothesisScorer(NOISE, UNEXPLAINED_COST)
WRONG_TURN = np.array([0.004, -0.006, 0.9])


@pytest.fixture(scope="module")
def known() -> ContactMap:
    return SCORER.smooth(true_map("triangle", count=10).with_best_kernel(), 60).map


def turned_from(known: ContactMap, step: int, turn: Array = WRONG_TURN) -> ContactMap:
    """The object frame of all grasps from a step on is another."""
    rows = known.rows.copy()
    rows[step:] = known.space.compose(rows[step:], turn)
    return known.with_rows(rows)


def crossed(forward: ContactMap, backward: ContactMap) -> list[Hypothesis]:
    return crossed_readings(forward, backward, SCORER, SETTINGS)


def test_each_reading_is_followed_where_it_is_right(known: ContactMap) -> None:
    """The one forwards is wrong between its first grasps, the one backwards between its last ones."""
    forward, backward = turned_from(known, 2), turned_from(known, 8, -WRONG_TURN)
    for given in ((forward, backward), (backward, forward)):
        best = crossed(*given)[0]
        assert best.cost < SCORER.score(known).cost + 1.0
        gaps = np.abs(known.space.deviation(best.map.rows, known.rows))
        assert gaps[:, :2].max() < 0.003
        assert gaps[:, 2].max() < 0.05
        np.testing.assert_array_equal(best.map.rows[0], known.rows[0])


def test_nothing_is_gained_where_one_reading_is_right(known: ContactMap) -> None:
    assert crossed(known, turned_from(turned_from(known, 2), 8)) == []


def test_readings_that_agree_are_not_joined(known: ContactMap) -> None:
    assert crossed(known, known) == []
    assert crossed(known, turned_from(known, 5)) == []


def test_contacts_are_left_out_as_the_reading_that_is_followed_does(known: ContactMap) -> None:
    first, then = known.without_contact(1, 0), known.without_contact(7, 2)
    joined = join_at(first, then, 4)
    assert [grasp.left_out for grasp in joined.placed] == [
        (first if index < 4 else then).placed[index].left_out for index in range(10)
    ]
    np.testing.assert_allclose(joined.rows, known.rows, atol=1e-12)
