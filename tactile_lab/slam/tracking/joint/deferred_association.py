"""Deferred association: places grasps later that could not be placed, or fitted badly, at first.

There are three possible explanations: the motion model from the neighbouring grasps; if the object was left in place, a
push of the closing hand; and, if the object was lost, poses anywhere on the known object, which need no motion at all
(relocation), unless the fingertips felt how it moved: then that has to be as wrong as the pose says. A grasp stays at
its place, or left out, unless the evidence of all contacts improves.

While the object is explored, and anywhere on it, a grasp needs most of its contacts to be placed. On a known object
near where the motion leads, two of them with their normals can be enough: otherwise grasps with two or three wrong
contacts of five stayed left out, a centimetre off.

Contacts are left out one by one, by a field of the others. A side that was touched late and seldom can be left out as a
whole in this way, while the field without it becomes ever surer. So all are heard again at once, with the kernel that
explains them, and the evidence decides, after flat faces: a short kernel explains wrong contacts, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer, cost
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings, propose

Relocate: TypeAlias = Callable[[ContactMap, ContactSet], Array]
"""Poses of a grasp's contacts anywhere on the object that a map describes, the best first, shape (m, size)."""

_TRIED = 3
_TRIED_NEAR = 8
_SMOOTHED, _SMOOTHING_STEPS = 2, 15
_LEAST_CONTACTS = 3
_LEAST_FITTING = 2
_DOUBTFUL = 2
"""Number of left-out contacts from which a grasp's place is searched again."""
CLEARLY_nats = 12.0
"""By which contacts that are heard again must make a hypothesis more likely: more than one wrong contact costs."""


def relocate_last(hypothesis: Hypothesis, relocate: Relocate, scorer: HypothesisScorer) -> list[Hypothesis]:
    """The hypothesis with its last grasp at other places on the object.

    Args:
        hypothesis: whose last grasp is left out, or on a part that nothing else supports.
        relocate: proposes places.
        scorer: scores them.
    """
    last = len(hypothesis.map.placed) - 1
    contacts = hypothesis.map.placed[last].contacts_world
    anywhere = relocate(hypothesis.map.without_grasp(last), contacts)[:_TRIED]
    return _place_at(hypothesis, last, anywhere, scorer, _most(contacts), _if_lost(hypothesis.map.placed[last]))


def propose_pushes(
    hypothesis: Hypothesis, noise: MotionNoise, settings: ProposalSettings, scorer: HypothesisScorer
) -> list[Hypothesis]:
    """The hypothesis with its last grasp at a place after a push, if the object was left in place and fits badly.

    Args:
        hypothesis: to improve.
        noise: of the motion model.
        settings: of the search.
        scorer: scores them.
    """
    last = len(hypothesis.map.placed) - 1
    grasp = hypothesis.map.placed[last]
    if not _is_doubtful(grasp) or not grasp.was_left(noise):
        return []
    near = _near(hypothesis, last, noise, settings)
    return _place_at(hypothesis, last, near, scorer, _most(grasp.contacts_world), Moved.PUSHED)


def associate_deferred(
    hypothesis: Hypothesis,
    noise: MotionNoise,
    settings: ProposalSettings,
    relocate: Relocate | None,
    scorer: HypothesisScorer,
    *,
    pushes: bool = True,
) -> Hypothesis:
    """The hypothesis with left-out or badly fitting grasps placed again where that is more likely.

    Args:
        hypothesis: to improve.
        noise: of the motion model.
        settings: of the search near the predicted pose.
        relocate: proposes places anywhere for left-out grasps; None for none.
        scorer: scores them.
        pushes: whether the closing hand may have pushed an object left in place.
    """
    for index, grasp in enumerate(hypothesis.map.placed[1:], start=1):
        if not _is_doubtful(grasp):
            continue
        near, contacts = _near(hypothesis, index, noise.accumulate(2), settings), grasp.contacts_world
        fitting = max(_LEAST_FITTING, len(grasp.kept) + 1)
        candidates = _place_at(hypothesis, index, near, scorer, fitting, Moved.AS_MEANT)
        if pushes and grasp.was_left(noise):
            candidates += _place_at(hypothesis, index, near, scorer, fitting, Moved.PUSHED)
        if relocate is not None and not grasp.used:
            anywhere = relocate(hypothesis.map.without_grasp(index), contacts)[:_TRIED]
            candidates += _place_at(hypothesis, index, anywhere, scorer, _most(contacts), _if_lost(grasp))
        hypothesis = min([hypothesis, *candidates], key=cost)
    return hypothesis


def readmit_contacts(hypothesis: Hypothesis, scorer: HypothesisScorer) -> list[Hypothesis]:
    """The hypothesis with all contacts that were left out heard again, if that is clearly more likely; smoothed.

    Args:
        hypothesis: whose contacts are heard.
        scorer: leaves contacts out, and smooths.
    """
    left_out = hypothesis.map.left_out_count
    if left_out < _DOUBTFUL:
        return []
    cleaned, _ = scorer.clean(hypothesis.map.with_all_contacts().with_best_kernel())
    if cleaned.left_out_count >= left_out:
        return []
    heard = scorer.smooth(cleaned.with_best_kernel(), _SMOOTHING_STEPS)
    return [heard] if heard.cost < hypothesis.cost - CLEARLY_nats else []


def _is_doubtful(grasp: PlacedGrasp) -> bool:
    return len(grasp.left_out) >= _DOUBTFUL and len(grasp.contacts_world) >= _LEAST_CONTACTS


def _if_lost(grasp: PlacedGrasp) -> Moved:
    """How an object moved that is found anywhere: a step that was felt is heavy-tailed, and says how far it may be off.

    An object that stood still for all that fingertips and motors felt was else turned by 176 degrees and 0.4 m away.
    """
    return Moved.FREELY if grasp.motion_sigma is None else Moved.AS_MEANT


def _near(hypothesis: Hypothesis, index: int, noise: MotionNoise, settings: ProposalSettings) -> Array:
    """Poses of a grasp on the object of all others, near where the motion leads, the best first."""
    space, grasp = hypothesis.map.space, hypothesis.map.placed[index]
    predicted = space.compose(grasp.motion, hypothesis.map.placed[index - 1].pose)
    field = hypothesis.map.without_grasp(index).fit()
    return propose(predicted, grasp.contacts_world, field, noise, settings, space)[0][:_TRIED_NEAR]


def _most(contacts: ContactSet) -> int:
    return len(contacts) // 2 + 1


def _place_at(
    hypothesis: Hypothesis, index: int, rows: Array, scorer: HypothesisScorer, fitting: int, moved: Moved
) -> list[Hypothesis]:
    """The hypothesis with one grasp at the most likely poses that enough contacts fit, smoothed."""
    found = []
    for row in rows:
        grasp = replace(hypothesis.map.placed[index], pose=row, left_out=frozenset(), moved=moved)
        cleaned, _ = scorer.clean(_with(hypothesis.map, index, grasp), index)
        if len(cleaned.placed[index].kept) >= fitting:
            found.append(scorer.score(cleaned))
    likeliest = sorted(found, key=cost)[:_SMOOTHED]
    return [_following(scorer.smooth(one.map, _SMOOTHING_STEPS), index, scorer) for one in likeliest]


def _following(hypothesis: Hypothesis, index: int, scorer: HypothesisScorer) -> Hypothesis:
    """The hypothesis with one grasp moved as the motion model expects, if that is no less likely."""
    bound = replace(hypothesis.map.placed[index], moved=Moved.AS_MEANT)
    return min(scorer.score(hypothesis.map.with_placed(index, bound)), hypothesis, key=cost)


def _with(contact_map: ContactMap, index: int, grasp: PlacedGrasp) -> ContactMap:
    placed = list(contact_map.placed)
    placed[index] = grasp
    following = np.flatnonzero(~np.array([one.used for one in placed]))
    for after in [int(i) for i in following if i > index]:  # grasps aside go where the motion leads them from here
        if any(one.used for one in placed[index + 1 : after]):
            break
        placed[after] = replace(
            placed[after], pose=contact_map.space.compose(placed[after].motion, placed[after - 1].pose)
        )
    return replace(contact_map, placed=tuple(placed))
