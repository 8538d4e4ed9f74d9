"""Cheap signs that some grasps are probably placed wrongly, each computed from the final trajectory alone.

A grasp that is turned the wrong way round needs two slips that undo each other: one into the wrong pose and one out of
it. A slip that the motion model hardly allows, a jump, or contacts that fit before some grasp and no longer after it
(another object, or a moved one) are visible in the same way. Each sign has a name that files and pages repeat.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.graph.chances import chi_squared_exceeded_by, chi_squared_tail, hypergeometric_tail
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost

_UNDONE = 0.02
"""Probability of each of two slips that undo each other, or less: chance makes one such pair in a hundred sessions, and
more where slips have heavy tails. So it is not grave if neither slip is improbable and the grasp's contacts confirm it.
"""

_UNDONE_COSINE = -0.7
"""Cosine of the angle between two slips that undo each other, or less; for a rotation it is -1 or 1."""

_UNLIKELY = 5e-4
"""Probability of a slip under the motion model below which it is told."""

_INCREDIBLE = 1e-6
"""The same below which it is grave although whole grasps confirm both places: slips have heavier tails than the model,
and one of five standard deviations happens to right trajectories too.
"""

_TOGETHER = 0.02
"""Probability of all slips but the largest together below which they are told. Leaving out the largest makes it strict:
normal slips pass in 998 sessions of 1000, slips with Student's t distribution of six degrees in 993.
"""

_LEAST_CARRIED = 5
"""Slips of a carried object that are judged together, at least."""

_CONFIRMING = 4
"""Contacts of a grasp that fit where it is, at least, to confirm its place."""

_JUMP_m = 0.100
_OTHER_OBJECT = 1e-4
_LEAST_GRASPS = 3
"""On each side of the grasp from which on another object may have been touched."""

_STRAY_SHARE = 0.18
"""Share of contacts that fit nothing from which on it is told. Where a tenth are wrong chance reaches it once in a
hundred sessions.
"""

_GRAVE_FIRST = 3
"""So many wrong contacts of the first grasp make the object frame itself doubtful; fewer are only told: the rest of the
session places it as well as any other grasp.
"""


def signs(contact_map: ContactMap, noise: MotionNoise, *, poses_given: bool = False) -> tuple[Doubt, ...]:
    """All signs of a trajectory that something is wrong with it.

    Args:
        contact_map: all grasps at their final poses, with the contacts that are left out.
        noise: of the motion model.
        poses_given: whether the poses were given and not estimated: then slips are no sign.
    """
    about_motion: tuple[Callable[[ContactMap, MotionNoise], list[Doubt]], ...] = (
        _undone,
        _unlikely,
        _large_together,
        _jumps,
    )
    found = [] if poses_given else [doubt for sign in about_motion for doubt in sign(contact_map, noise)]
    return (*found, *(_other_object(contact_map) or _strays(contact_map)), *_first_grasp(contact_map))


def _slips(contact_map: ContactMap, noise: MotionNoise) -> tuple[Array, NDArray[np.bool_]]:
    """Slips of a trajectory in standard deviations, shape (k - 1, size), and whether each is bound to the hand."""
    cost = MotionCost.of(contact_map, noise)
    bound = np.array([how is Moved.AS_MEANT for how in contact_map.moved[1:]], dtype=bool)
    return cost.scaled_slips(contact_map.rows), bound


def _confirmed(contact_map: ContactMap) -> NDArray[np.bool_]:
    """Whether the contacts of each grasp confirm where it is, shape (k,)."""
    return np.array([len(grasp.kept) >= _CONFIRMING for grasp in contact_map.placed])


def _confirmed_steps(contact_map: ContactMap) -> NDArray[np.bool_]:
    """Whether the contacts of the grasps before and after each step confirm where they are, shape (k - 1,)."""
    confirmed = _confirmed(contact_map)
    return confirmed[1:] & confirmed[:-1]


def _undone(contact_map: ContactMap, noise: MotionNoise) -> list[Doubt]:
    slips, bound = _slips(contact_map, noise)
    split, found = contact_map.space.translations, []
    unlikely = chi_squared_tail(np.sum(slips**2, axis=1), contact_map.space.size) < _UNLIKELY
    doubtful = unlikely[1:] | unlikely[:-1] | ~_confirmed(contact_map)[1:-1]
    for part, kind in ((slice(None, split), "moved"), (slice(split, None), "turned")):
        vectors = slips[:, part]
        lengths = np.linalg.norm(vectors, axis=1)
        least = math.sqrt(chi_squared_exceeded_by(_UNDONE, vectors.shape[1]))
        cosines = np.sum(vectors[1:] * vectors[:-1], axis=1) / np.maximum(lengths[1:] * lengths[:-1], 1e-12)
        opposite = (cosines < _UNDONE_COSINE) & (np.minimum(lengths[1:], lengths[:-1]) > least)
        for step in np.flatnonzero(opposite & bound[1:] & bound[:-1]):
            grasp = int(step) + 1
            words = f"grasp {grasp + 1} is {kind} by a slip that the next one undoes: it is probably placed wrongly"
            found.append(Doubt("undone-slips", words, (grasp,), grave=bool(doubtful[step])))
    return found


def _unlikely(contact_map: ContactMap, noise: MotionNoise) -> list[Doubt]:
    slips, bound = _slips(contact_map, noise)
    probabilities = chi_squared_tail(np.sum(slips**2, axis=1), contact_map.space.size)
    doubtful = (probabilities < _INCREDIBLE) | ~_confirmed_steps(contact_map)
    return [
        Doubt(
            "unlikely-slip",
            f"the slip before grasp {step + 2} is improbable ({probabilities[step]:.0e}): was the object moved, or "
            "is a grasp placed wrongly?",
            (int(step) + 1,),
            grave=bool(doubtful[step]),
        )
        for step in np.flatnonzero((probabilities < _UNLIKELY) & bound)
    ]


def _large_together(contact_map: ContactMap, noise: MotionNoise) -> list[Doubt]:
    """Whether slips of a carried object are too large on the whole: wrong places of many grasps need many of them.

    A single large one does not count. Nor do steps that the fingertips measured, or in which the object was left in
    place: those have heavy tails of their own.
    """
    slips, bound = _slips(contact_map, noise)
    measured = np.array([sigma is not None for sigma in contact_map.motion_sigmas[1:]], dtype=bool)
    carried = bound & ~measured & contact_map.motions[1:].any(axis=1)
    if carried.sum() < _LEAST_CARRIED:
        return []
    squared = np.sum(slips[carried] ** 2, axis=1)
    chance = float(chi_squared_tail(squared.sum() - squared.max(), (len(squared) - 1) * contact_map.space.size))
    if chance >= _TOGETHER:
        return []
    words = (
        "the slips are larger together than the motion model allows: grasps are placed wrongly, or the setting motion "
        "is too small"
    )
    return [Doubt("large-slips", words)]


def _jumps(contact_map: ContactMap, noise: MotionNoise) -> list[Doubt]:
    space, rows = contact_map.space, contact_map.rows
    expected = space.compose(contact_map.motions[1:], rows[:-1])
    away_m = np.linalg.norm(space.deviation(rows[1:], expected)[:, : space.translations], axis=1)
    alone = np.array([how is Moved.FREELY for how in contact_map.moved[1:]], dtype=bool)
    grave = (away_m > _JUMP_m) | ~_confirmed_steps(contact_map)
    return [
        Doubt(
            "jump",
            f"the object is {1e3 * away_m[step]:.0f} mm from where the hand left it before grasp {step + 2}: "
            "did it fall, was it moved or exchanged?",
            (int(step) + 1,),
            grave=bool(grave[step]),
        )
        for step in np.flatnonzero((away_m > _JUMP_m) | alone)
    ]


def _other_object(contact_map: ContactMap) -> list[Doubt]:
    """Whether contacts fit up to some grasp and mostly do not from then on, or the other way round.

    The exact test of Fisher at the most telling grasp, with a limit that allows for the choice of the grasp.
    """
    wrong = np.array([len(grasp.left_out) for grasp in contact_map.placed])
    total = np.array([len(grasp.contacts_world) for grasp in contact_map.placed])
    count, found = len(wrong), []
    for split in range(_LEAST_GRASPS, count - _LEAST_GRASPS + 1):
        after = int(wrong[split:].sum())
        chance = hypergeometric_tail(after, int(total.sum()), int(wrong.sum()), int(total[split:].sum()))
        before = int(wrong[:split].sum())
        chance = min(chance, hypergeometric_tail(before, int(total.sum()), int(wrong.sum()), int(total[:split].sum())))
        found.append((float(chance), split))
    chance, split = min(found, default=(1.0, 0))
    if chance > _OTHER_OBJECT:
        return []
    words = f"contacts before and from grasp {split + 1} on do not fit one object: was it exchanged, moved or deformed?"
    return [Doubt("other-object", words, tuple(range(split, count)))]


def _strays(contact_map: ContactMap) -> list[Doubt]:
    """Whether more contacts fit nothing than sensors get wrong: then some grasps are elsewhere."""
    used = [grasp for grasp in contact_map.placed if grasp.used]
    wrong = sum(len(grasp.left_out) for grasp in used)
    total = sum(len(grasp.contacts_world) for grasp in used)
    if wrong <= _STRAY_SHARE * total:
        return []
    words = f"{wrong} of {total} contacts fit nothing else: some grasps are probably placed wrongly"
    return [Doubt("stray-contacts", words)]


def _first_grasp(contact_map: ContactMap) -> list[Doubt]:
    wrong = len(contact_map.placed[0].left_out)
    if contact_map.archive or not wrong:
        return []
    which = "contact" if wrong == 1 else "contacts"
    words = f"{wrong} {which} of the first grasp, which defines the object frame, fit nothing else"
    return [Doubt("first-grasp", words, (0,), grave=wrong >= _GRAVE_FIRST)]
