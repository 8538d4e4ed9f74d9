"""Grasps that could not be placed when they came, or not well: where they belong is looked for with more known.

Two ways lead there: the motion model from the neighbouring grasps, and, if the object was lost, poses anywhere on the
known object, which need no motion at all (relocation). Nothing is forced: a grasp stays where it is or aside unless
the evidence for all contacts gets better.

While the object is explored, and anywhere on it, a grasp needs most of its contacts to be placed. On a known object
near where the motion leads, two of them with their normals can be enough: fingers with two or three wrong contacts of
five else stayed aside, a centimetre off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from tactile_lab.geometry.contacts import Array
from tactile_lab.tracking.contact_map import ContactMap, PlacedGrasp
from tactile_lab.tracking.contact_set import ContactSet
from tactile_lab.tracking.hypotheses import Hypothesis, Judge, cost
from tactile_lab.tracking.motion import MotionNoise
from tactile_lab.tracking.proposals import ProposalSettings, propose

Relocate: TypeAlias = Callable[[ContactMap, ContactSet], Array]
"""Poses of a grasp's contacts anywhere on the object that a map describes, the best first, shape (m, size)."""

_TRIED = 3
_TRIED_NEAR = 8
_SMOOTHED = 2
_LEAST_CONTACTS = 3
_LEAST_FITTING = 2
_DOUBTFUL = 2
"""So many contacts of a grasp have to be left out for its place to be looked for again."""


def relocated(hypothesis: Hypothesis, relocate: Relocate, judge: Judge) -> list[Hypothesis]:
    """The hypothesis with its last grasp at other places on the object.

    Args:
        hypothesis: whose last grasp is aside, or on ground that nothing else supports.
        relocate: proposes places.
        judge: rates them.
    """
    last = len(hypothesis.map.placed) - 1
    contacts = hypothesis.map.placed[last].contacts_world
    anywhere = relocate(hypothesis.map.without_grasp(last), contacts)[:_TRIED]
    return _placed_at(hypothesis, last, anywhere, judge, _most(contacts), moved_freely=True)


def placed_late(
    hypothesis: Hypothesis, noise: MotionNoise, settings: ProposalSettings, relocate: Relocate | None, judge: Judge
) -> Hypothesis:
    """The hypothesis with grasps that are aside or fit badly placed anew, one after the other, where that is likelier.

    Args:
        hypothesis: to improve.
        noise: of the motion model.
        settings: of the search near the predicted pose.
        relocate: proposes places anywhere for grasps that are aside; None for none.
        judge: rates them.
    """
    for index, grasp in enumerate(hypothesis.map.placed[1:], start=1):
        if len(grasp.left_out) < _DOUBTFUL or len(grasp.contacts_world) < _LEAST_CONTACTS:
            continue
        others, contacts = hypothesis.map.without_grasp(index), grasp.contacts_world
        space = hypothesis.map.space
        predicted = space.compose(grasp.motion, hypothesis.map.placed[index - 1].row)
        near, _ = propose(predicted, contacts, others.fit(), noise.accumulated(2), settings, space)
        fitting = max(_LEAST_FITTING, len(hypothesis.map.placed[index].kept) + 1)
        candidates = _placed_at(hypothesis, index, near[:_TRIED_NEAR], judge, fitting, moved_freely=False)
        if relocate is not None and not grasp.used:
            anywhere = relocate(others, contacts)[:_TRIED]
            candidates += _placed_at(hypothesis, index, anywhere, judge, _most(contacts), moved_freely=True)
        hypothesis = min([hypothesis, *candidates], key=cost)
    return hypothesis


def _most(contacts: ContactSet) -> int:
    return len(contacts) // 2 + 1


def _placed_at(
    hypothesis: Hypothesis, index: int, rows: Array, judge: Judge, fitting: int, *, moved_freely: bool
) -> list[Hypothesis]:
    """The hypothesis with one grasp at the likeliest poses that enough contacts fit, smoothed."""
    found = []
    for row in rows:
        grasp = replace(hypothesis.map.placed[index], row=row, left_out=frozenset(), moved_freely=moved_freely)
        cleaned, _ = judge.cleaned(_with(hypothesis.map, index, grasp), index)
        if len(cleaned.placed[index].kept) >= fitting:
            found.append(judge.rated(cleaned))
    likeliest = sorted(found, key=cost)[:_SMOOTHED]
    return [_following(judge.smoothed(one.map, 15), index, judge) for one in likeliest]


def _following(hypothesis: Hypothesis, index: int, judge: Judge) -> Hypothesis:
    """The hypothesis with one grasp as the motion model has it after all, if that is no less likely."""
    bound = replace(hypothesis.map.placed[index], moved_freely=False)
    return min(judge.rated(hypothesis.map.with_placed(index, bound)), hypothesis, key=cost)


def _with(contact_map: ContactMap, index: int, grasp: PlacedGrasp) -> ContactMap:
    placed = list(contact_map.placed)
    placed[index] = grasp
    following = np.flatnonzero(~np.array([one.used for one in placed]))
    for after in [int(i) for i in following if i > index]:  # grasps aside go where the motion leads them from here
        if any(one.used for one in placed[index + 1 : after]):
            break
        placed[after] = replace(
            placed[after], row=contact_map.space.compose(placed[after].motion, placed[after - 1].row)
        )
    return replace(contact_map, placed=tuple(placed))
