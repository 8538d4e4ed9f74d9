"""Crossed readings: joins the beginning of one reading of a session with the end of another.

A reading that starts with wrong contacts goes wrong where it starts: forwards that is at the first grasps, backwards at
the last ones. Each of the two is right where the other is not, and moving single grasps or one part of a trajectory
mends neither. So one is followed up to some grasp, which has the same place on the object in both, and the other from
there on.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.joint.deferred_association import CLEARLY_nats
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, cost
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings, elsewhere

_CLEANED, _SMOOTHED, _SMOOTHING_STEPS = 4, 2, 15
"""How many of the most promising are tested for contacts that do not fit, and smoothed, and steps of that."""


def crossed_readings(
    forward: ContactMap, backward: ContactMap, scorer: HypothesisScorer, settings: ProposalSettings
) -> list[Hypothesis]:
    """Two readings of the same grasps joined, smoothed, where that is clearly more likely than both.

    Args:
        forward, backward: the readings.
        scorer: leaves contacts out, and smooths.
        settings: say how far apart poses are different places.
    """
    differ = _differing_steps(forward, backward, settings)
    cuts = [(one + other) // 2 for one, other in pairwise(differ)]
    pairs = (forward, backward), (backward, forward)
    joined = [join_at(first, then, cut) for first, then in pairs for cut in cuts]
    promising = sorted(joined, key=scorer.rough_cost)[:_CLEANED]
    cleaned = [scorer.score(scorer.clean(each)[0]) for each in promising]
    smoothed = [scorer.smooth(each.map, _SMOOTHING_STEPS) for each in sorted(cleaned, key=cost)[:_SMOOTHED]]
    limit = min(scorer.score(each).cost for each in (forward, backward)) - CLEARLY_nats
    return [each for each in smoothed if each.cost < limit]


def join_at(first: ContactMap, then: ContactMap, cut: int) -> ContactMap:
    """One reading before a grasp and another from it on, the grasp at its place in the first one."""
    space, later = first.space, then.rows[cut:]
    then_T_first = space.compose(space.inverse(later[0]), first.rows[cut])
    moved = space.compose(later, then_T_first)
    placed = [replace(grasp, pose=row) for grasp, row in zip(then.placed[cut:], moved, strict=True)]
    return replace(first, placed=(*first.placed[:cut], *placed))


def _differing_steps(one: ContactMap, other: ContactMap, settings: ProposalSettings) -> list[int]:
    """The grasps, by number, to which two readings lead by different motions of the object."""
    space, rows = one.space, one.rows
    motions = space.compose(other.rows[1:], space.inverse(other.rows[:-1]))
    moved = space.compose(motions, rows[:-1])
    pairs = zip(moved, rows[1:], strict=True)
    return [step for step, (row, there) in enumerate(pairs, start=1) if elsewhere(row[None], there, settings, space)[0]]
