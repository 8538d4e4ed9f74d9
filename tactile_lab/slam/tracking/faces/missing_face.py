"""A face that all grasps were turned away from.

An outline of n equal turns looks the same after each of them. If a turn is no larger than a slip, a trajectory may have
every grasp turned in such a way that it touches n - 1 of the faces, which meet in one corner twice as sharp as the
others. With a face less to pay for that is about as likely as the truth. But with all n faces every grasp has n places,
and the shape is as likely as all of them together; without the last face only those places count that do without it.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces, flat_faces
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, cost

_FEWEST_TURNS = 6
"""Larger turns are no slips."""

_ALIKE_rad = float(np.deg2rad(12.0))
"""Largest deviation of a corner from those of a regular outline."""


def with_missing_face(best: Hypothesis, sharp: FacetedScorer, noise: MotionNoise) -> Hypothesis:
    """The hypothesis, or the one with the missing face of a regular outline if that is more likely.

    Args:
        best: a trajectory; those in space, of long sessions and of objects without flat faces are unchanged.
        sharp: scores hypotheses by flat faces.
        noise: of the motion model.
    """
    if best.map.dimension == 3 or best.map.archive or not sharp.is_sharp(best):
        return best
    try:
        faces, _ = flat_faces(best.map)
    except ShapeError:
        return best
    first = _after_missing_face(faces)
    if first is None:
        return best
    places = _turned_places(best.map.rows, faces)
    steps = _step_costs(MotionCost.of(best.map, noise), places)
    turns = _likeliest_turns(steps)
    turned = best.map.with_rows(places[turns, np.arange(len(turns))])
    found = min(sharp.better(turned), sharp.smooth(turned), key=cost)
    without_it = _ways(steps, _doing_without(best.map, faces, first), np.zeros_like(turns))
    gain = _ways(steps, np.ones((len(turns), len(places)), dtype=bool), turns) - without_it
    return found if found.cost - gain < best.cost else best


def _after_missing_face(faces: FlatFaces) -> int | None:
    """The face after the one corner that is twice as sharp as the others; None if an outline has no such corner."""
    directions = np.arctan2(faces.normals[:, 1], faces.normals[:, 0])
    corners = np.angle(np.exp(1j * (directions - np.roll(directions, 1))))
    sharpest, turn_rad = int(corners.argmax()), 2 * np.pi / (faces.count + 1)
    expected = np.full(faces.count, turn_rad)
    expected[sharpest] *= 2
    regular = faces.count + 1 >= _FEWEST_TURNS and np.abs(corners - expected).max() < _ALIKE_rad
    return sharpest if regular else None


def _turned_places(rows: Array, faces: FlatFaces) -> Array:
    """Poses of shape (k, 3) after each turn about the middle of the faces, shape (n, k, 3)."""
    count = faces.count + 1
    middle = np.linalg.lstsq(np.column_stack([faces.normals, np.ones(faces.count)]), faces.offsets_m, rcond=None)[0][:2]
    places = []
    for turn_rad in 2 * np.pi * np.arange(count) / count:
        turned = np.array([[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]]) @ middle
        places.append(PLANAR.compose(rows, np.tile(np.append(middle - turned, turn_rad), (len(rows), 1))))
    return np.array(places)


def _step_costs(motion: MotionCost, places: Array) -> Array:
    """The cost of each step from each place before it to each one after it, shape (k - 1, n, n)."""
    count, grasps = places.shape[:2]
    costs, even = np.empty((grasps - 1, count, count)), np.arange(grasps)[:, None] % 2 == 0
    for one, other in product(range(count), repeat=2):
        steps = motion.steps(np.where(even, places[one], places[other]))
        costs[0::2, one, other], costs[1::2, other, one] = steps[0::2], steps[1::2]
    return costs


def _likeliest_turns(steps: Array) -> NDArray[np.intp]:
    """The place of each grasp on the way of least cost, by dynamic programming; the first grasp stays."""
    cost, before = np.where(np.arange(steps.shape[1]) == 0, 0.0, np.inf), []
    for step in steps:
        total = cost[:, None] + step
        before.append(total.argmin(axis=0))
        cost = total.min(axis=0)
    turns = [int(cost.argmin())]
    for each in reversed(before):
        turns.append(int(each[turns[-1]]))
    return np.array(turns[::-1])


def _ways(steps: Array, allowed: NDArray[np.bool_], way: NDArray[np.intp]) -> float:
    """How much more likely all allowed ways are together than one of them (natural logarithm).

    Args:
        steps: costs, shape (k - 1, n, n).
        allowed: places of each grasp, shape (k, n).
        way: the place of each grasp on that one, shape (k,).
    """
    gain = np.where(np.arange(allowed.shape[1]) == 0, 0.0, -np.inf)
    for step, here in zip(steps, allowed[1:], strict=True):
        gain = np.where(here, logsumexp(gain[:, None] - step, axis=0), -np.inf)
    return float(logsumexp(gain) + steps[np.arange(len(steps)), way[:-1], way[1:]].sum())


def _doing_without(contact_map: ContactMap, faces: FlatFaces, first: int) -> NDArray[np.bool_]:
    """Places of each grasp in which none of its contacts is on the missing face, shape (k, n)."""
    count = faces.count + 1
    on_face = (faces.labels - first) % faces.count
    onto_missing = (on_face[:, None] - np.arange(count)) % count == faces.count
    without = np.ones((len(contact_map.placed), count), dtype=bool)
    np.logical_and.at(without, contact_map.grasp_indices, ~onto_missing)
    return without
