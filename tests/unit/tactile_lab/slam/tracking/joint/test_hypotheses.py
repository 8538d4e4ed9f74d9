"""How trajectories are scored, cleaned of contacts that do not fit, and told from one another."""

from __future__ import annotations

from dataclasses import replace
from math import comb, log

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost, pushed_nats
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, likeliest, weights
from tactile_lab.slam.tracking.joint.mechanisms import Mechanisms
from tests.support.simulated_contacts import true_map

NOISE, UNEXPLAINED = MotionNoise(unheld=0.5), 8.0
SCORER = HypothesisScorer(NOISE, UNEXPLAINED)
WITHOUT_VALLEYS = HypothesisScorer(NOISE, UNEXPLAINED, Mechanisms(frozenset({"valleys"})))


@pytest.fixture(scope="module")
def known() -> ContactMap:
    return true_map("rectangle", count=4).with_best_kernel()


def leaving_out(known: ContactMap, *wanted: tuple[int, int]) -> ContactMap:
    for grasp, contact in wanted:
        known = known.without_contact(grasp, contact)
    return known


def moved(known: ContactMap, grasp: int, how: Moved) -> ContactMap:
    placed = list(known.placed)
    placed[grasp] = replace(placed[grasp], moved=how)
    return replace(known, placed=tuple(placed))


def of_cost(known: ContactMap, cost: float) -> Hypothesis:
    return Hypothesis(known, cost - 3.0, 2.0, 1.0)


def shaken(known: ContactMap, grasp: int, by: tuple[float, float, float]) -> ContactMap:
    rows: Array = known.rows.copy()
    rows[grasp] += by
    return known.with_rows(rows)


def test_a_cost_is_that_of_poses_contacts_free_space_and_of_what_was_settled(known: ContactMap) -> None:
    scored = SCORER.score(known)
    assert scored.misfit == pytest.approx(PoseEvidence(known, NOISE).value(known.rows))
    assert scored.cost == pytest.approx(scored.misfit + scored.intrusion + scored.left_out)
    assert scored.intrusion >= 0.0
    settled = replace(scored, map=replace(known, settled_cost=5.0))
    assert settled.cost == pytest.approx(scored.cost + 5.0)
    motion = MotionCost.of(known, NOISE).value(known.rows)
    shape = known.fit().log_marginal_likelihood()
    assert scored.misfit - motion + shape == pytest.approx(-1.5 * len(known.contacts) * log(2 * np.pi))


@pytest.mark.parametrize("wrong", [0, 1, 3])
def test_the_more_contacts_are_wrong_the_less_surprising_is_one_more(known: ContactMap, wrong: int) -> None:
    """A share of wrong contacts drawn with one wrong to 99 right in mind: a beta-binomial."""
    spoilt = leaving_out(known, *((grasp, 0) for grasp in range(1, wrong + 1)))
    right = len(spoilt.contacts)
    sequence = 99.0 / ((right + wrong + 99) * comb(right + wrong + 98, wrong))  # that just these are wrong
    none = 99.0 / (right + wrong + 99)
    expected = wrong * UNEXPLAINED - log(sequence / none)
    nothing = SCORER.price(known)
    assert SCORER.price(spoilt) - nothing == pytest.approx(expected - wrong * log(100.0))


def test_steps_in_which_the_object_did_not_go_with_the_hand_have_their_prices(known: ContactMap) -> None:
    nothing = SCORER.price(known)
    assert SCORER.price(moved(known, 2, Moved.FREELY)) - nothing == pytest.approx(20.0)
    pushed = moved(moved(known, 2, Moved.PUSHED), 3, Moved.PUSHED)
    assert SCORER.price(pushed) - nothing == pytest.approx(2 * pushed_nats(NOISE, known.space))


def test_likeliest_are_few_and_not_far_behind_the_best(known: ContactMap) -> None:
    all_of_them = [of_cost(known, cost) for cost in (7.0, 3.0, 5.0, 4.0)]
    assert [one.cost for one in likeliest(all_of_them, 3, 10.0)] == [3.0, 4.0, 5.0]
    assert [one.cost for one in likeliest(all_of_them, 4, 2.0)] == [3.0, 4.0]
    assert weights(all_of_them[:2]) == pytest.approx([np.exp(-4) / (1 + np.exp(-4)), 1 / (1 + np.exp(-4))])


def test_a_contact_is_left_out_while_it_costs_more_than_one_that_nothing_explains(known: ContactMap) -> None:
    assert SCORER.clean(known)[0].left_out_count == 0
    torn = known.placed[2].contacts_world
    normals = torn.normals.copy()
    normals[1] *= -1.0
    grasps = list(known.placed)
    grasps[2] = replace(grasps[2], contacts_world=replace(torn, normals=normals))
    spoilt = replace(known, placed=tuple(grasps))
    cleaned, value = SCORER.clean(spoilt)
    assert [sorted(grasp.left_out) for grasp in cleaned.placed] == [[], [], [1], []]
    assert value == pytest.approx(PoseEvidence(cleaned, NOISE).value(cleaned.rows))
    assert SCORER.clean(spoilt, grasp=1)[0].left_out_count == 0
    assert HypothesisScorer(NOISE, 1e6).clean(spoilt)[0].left_out_count == 0


@pytest.mark.parametrize(
    ("by", "same"),
    [
        ((0.0009, -0.0009, 0.029), True),
        ((0.0011, 0.0, 0.0), False),
        ((0.0, -0.0011, 0.0), False),
        ((0.0, 0.0, 0.031), False),
    ],
)
def test_trajectories_within_a_millimetre_and_a_few_degrees_are_one(
    known: ContactMap, by: tuple[float, float, float], same: bool
) -> None:
    likely, other = of_cost(known, 1.0), of_cost(shaken(known, 2, by), 2.0)
    assert WITHOUT_VALLEYS.different([other, likely]) == ([likely] if same else [likely, other])
    assert WITHOUT_VALLEYS.unlike([other], [likely]) == ([] if same else [other])


def test_poses_that_contacts_do_not_tell_apart_are_one_unless_other_contacts_are_left_out(known: ContactMap) -> None:
    """A shift by half a standard deviation as the contacts have it, too large to be near."""
    information = PoseEvidence(known, NOISE).information(known.rows)
    covariance = np.linalg.inv(information)
    weakest = np.linalg.eigh(covariance)[1][:, -1]
    sigma = float(np.sqrt(weakest @ covariance @ weakest))

    def along_weakest(sigmas: float) -> Hypothesis:
        rows = known.rows.copy()
        rows[1:] += (sigmas * sigma * weakest).reshape(rows[1:].shape)
        return of_cost(known.with_rows(rows), 2.0)

    likely, close, away = of_cost(known, 1.0), along_weakest(1.5), along_weakest(6.0)
    assert WITHOUT_VALLEYS.different([likely, close]) == [likely, close]
    assert SCORER.different([likely, close]) == [likely]
    assert SCORER.different([likely, away]) == [likely, away]
    without = replace(close, map=leaving_out(close.map, (2, 0)))
    assert SCORER.different([likely, without]) == [likely, without]
    assert SCORER.different([likely, without], by_contacts=False) == [likely]
    SCORER.forget()
