"""Alternatives to an estimate: other placings of its grasps, with their probabilities.

The search for the best trajectory leaves others behind that are less likely by some nats. Those that place a grasp, or
a run of grasps, elsewhere are alternatives, and the gaps between their costs are their probabilities. A shape with a
symmetry of few turns has more of them: all grasps from some step on turned by one of these turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Alternative, Doubt
from tactile_lab.slam.doubt.symmetry import Symmetry
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR, PoseVectors
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer

REACH = 0.05
"""Probability of all alternatives together from which an estimate is ambiguous."""

_TRUST = 0.5
"""Share of the difference of two costs that counts. The evidence takes errors of contacts and slips as independent and
normal, which they are not quite: a trajectory with a grasp placed wrongly may be more likely than the true one by five
nats, and right ones hardly have a rival within seven (decisions 64 and 118).
"""

_GRAVE_m = 0.003
"""An alternative that displaces contacts by less, root mean square, is told but does not make the estimate ambiguous:
one grasp of sixteen that is a centimetre off changes neither the shape nor the rest of the trajectory.
"""

_LEAST_TOLD = 0.01
_LEAST_SHIFT_m = 0.005
_SYMMETRIC_m = 0.010
"""Left of a turn by a symmetry: the grasp is a little off at its other place too."""

_SAME_m = 0.004
_FARTHEST_nats = 8.0
_MOST_TURNED = 4
"""Turns whose slips cost more are not tried, and no more than so many."""


def alternatives(
    best: ContactMap,
    found: Sequence[tuple[ContactMap, float]],
    symmetry: Symmetry | None,
    origin_height_m: float,
) -> tuple[Alternative, ...]:
    """The alternatives that are likely enough to be told, the most likely first.

    Args:
        best: the estimate.
        found: other maps of the same grasps, and how much more each costs (natural logarithm).
        symmetry: of the object; placings that differ only by its turns, if they are interchangeable, are the same.
        origin_height_m: of the object frame over the table.
    """
    different: list[tuple[tuple[int, ...], Array, float]] = []
    for other, gap in sorted(found, key=lambda each: each[1]):
        rows = _in_same_frame(best, other)
        shifts = _shifts(best, rows)
        moved = tuple(int(i) for i in np.flatnonzero(shifts > _LEAST_SHIFT_m))
        turned_only = symmetry is not None and symmetry.interchangeable and _all_turns(best, rows, moved, symmetry)
        known = any(moved == grasps and _are_alike(best, rows, others) for grasps, others, _ in different)
        if moved and not turned_only and not known:
            different.append((moved, rows, max(gap, 0.0)))
    weights = np.exp([-_TRUST * gap for *_, gap in different])
    probabilities = weights / (1.0 + weights.sum())
    made = [
        _alternative(best, moved, rows, float(chance), origin_height_m)
        for (moved, rows, _), chance in zip(different, probabilities, strict=True)
    ]
    return tuple(one for one in made if one.probability >= _LEAST_TOLD)


def displaced(best: ContactMap, alternative: Alternative) -> ContactMap:
    """The map with the grasps of an alternative at its poses.

    Args:
        best: the estimate.
        alternative: to it.
    """
    rows = best.rows
    for grasp, pose in zip(alternative.grasps, alternative.world_T_object, strict=True):
        rows[grasp] = best.space.motion(pose)
    return best.with_rows(rows)


def turned_by_symmetry(
    best: ContactMap, symmetry: Symmetry, noise: MotionNoise, unexplained_cost: float
) -> list[tuple[ContactMap, float]]:
    """The trajectory with all grasps from some step on turned by a symmetry, smoothed, and what each costs more.

    Args:
        best: the estimate; only the steps of an object on a table are tried.
        symmetry: of its shape, perhaps an approximate one.
        noise: of the motion model.
        unexplained_cost: of a contact that nothing explains.
    """
    if best.space is not PLANAR or symmetry.interchangeable:
        return []
    motion, rows = MotionCost.of(best, noise), best.rows
    now, turned = motion.steps(rows), []
    for step, turn in product(range(1, len(rows)), range(1, symmetry.order)):
        other = rows.copy()
        other[step:] = PLANAR.compose(rows[step:], symmetry.offset(turn))
        turned.append((float(motion.steps(other)[step - 1] - now[step - 1]), other))
    likely = sorted((each for each in turned if each[0] < _FARTHEST_nats), key=lambda each: each[0])[:_MOST_TURNED]
    if not likely:
        return []
    sharp = FacetedScorer(HypothesisScorer(noise, unexplained_cost), noise)
    cost = sharp.better(best).cost
    return [(found.map, found.cost - cost) for found in (sharp.smooth(best.with_rows(other)) for _, other in likely)]


def doubts_of(found: Sequence[Alternative]) -> tuple[Doubt, ...]:
    """The doubt that alternatives are, if they are likely enough together; grave if those that displace much are."""
    if (together := sum(one.probability for one in found)) < REACH:
        return ()
    grave = sum(one.probability for one in found if one.rms_m > _GRAVE_m) >= REACH
    grasps = tuple(sorted({grasp for one in found for grasp in one.grasps}))
    words = f"another placing is possible ({together:.0%}): {found[0].words()}"
    return (Doubt("rivals", words, grasps, grave),)


def _in_same_frame(best: ContactMap, other: ContactMap) -> Array:
    """The other poses, in the object frame in which most grasps agree with the estimate, and these best."""
    space = best.space
    offsets = space.compose(space.inverse(best.rows), other.rows)
    away_m = [np.minimum(_lengths(space, space.deviation(offsets, one)), _SAME_m).sum() for one in offsets]
    return space.compose(other.rows, space.inverse(offsets[int(np.argmin(away_m))]))


def _are_alike(best: ContactMap, rows: Array, others: Array) -> bool:
    """Whether two trajectories in the same frame place all contacts alike."""
    return bool(_shifts(best.with_rows(others), rows).max(initial=0.0) <= _LEAST_SHIFT_m)


def _lengths(space: PoseVectors, gaps: Array) -> Array:
    """Displacements of pose vectors at a lever of some centimetres, shape (n,)."""
    split = space.translations
    return np.asarray(np.linalg.norm(gaps[:, :split], axis=1) + 0.03 * np.linalg.norm(gaps[:, split:], axis=1))


def _shifts(best: ContactMap, rows: Array) -> Array:
    """The largest displacement of each grasp's contacts in the object frame, metres; 0 without contacts."""
    return np.array([each.max(initial=0.0) for each in _displacements(best, rows)])


def _displacements(best: ContactMap, rows: Array) -> list[Array]:
    """The displacements of each grasp's contacts in the object frame, metres."""
    moved = [
        grasp.contacts_world.in_object_frame(row, best.space).points_m - best.contacts_of(index).points_m
        for index, (grasp, row) in enumerate(zip(best.placed, rows, strict=True))
    ]
    return [np.linalg.norm(each, axis=1) for each in moved]


def _all_turns(best: ContactMap, rows: Array, moved: Sequence[int], symmetry: Symmetry) -> bool:
    """Whether all displaced grasps on a table are turned by the symmetry alone."""
    if best.space is not PLANAR:
        return False
    offsets = PLANAR.compose(PLANAR.inverse(best.rows), rows)
    return all(symmetry.explains(offsets[index], _SYMMETRIC_m) for index in moved)


def _alternative(
    best: ContactMap, moved: tuple[int, ...], rows: Array, probability: float, origin_height_m: float
) -> Alternative:
    space, chosen = best.space, list(moved)
    gaps = space.deviation(rows[chosen], best.rows[chosen])
    turn_rad = float(np.linalg.norm(gaps[:, space.translations :], axis=1).max())
    poses = tuple(space.pose(row, origin_height_m) for row in rows[chosen])
    shifts = np.concatenate(_displacements(best, rows))
    return Alternative(moved, poses, probability, turn_rad, float(shifts.max()), float(np.sqrt(np.mean(shifts**2))))


def costs_above(best: Hypothesis, rivals: Sequence[Hypothesis]) -> list[tuple[ContactMap, float]]:
    """Rivals with how much more they cost than the estimate."""
    return [(one.map, one.cost - best.cost) for one in rivals]
