"""Whether the grasps before and after some step can be of one object: then their contacts predict each other.

The poses of another object's grasps are free, so that they can often be placed on the first one or beside it: what fits
is kept, the rest is left out as wrong contacts, and every slip is small. But the two parts tell nothing about each
other. The evidence of all contacts together exceeds that of both parts, each with a surface of its own, by about a nat
for every contact of one object, and by nothing for two objects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.joint.proposals import UNEXPLAINED_COST

LEAST_nats = 0.3
"""Gain for each contact of the smaller part. Where it is least, 22 single objects with 14 to 16 grasps at their true
poses have 0.7 to 2.0, and a rectangle that was exchanged for a triangle -0.1.
"""

_LEAST_GRASPS = 3
_MOST_GRASPS = 8
"""On each side of a step: evidence of more of them changes nothing, and takes long."""

_NEAR_m, _LARGEST_ANGLE_rad = 0.020, float(np.deg2rad(60.0))
_LEAST_SHARED = 0.1
"""Share of the smaller part's contacts that lie near contacts of the other. With less, both may be sides of one object
that were touched one after the other; but nothing says so.
"""

_LOOSE_SHARED, _LOOSE_GRASPS = 0.3, 4
"""Two parts of so many grasps or more that share less hang together by the hand's motion alone. Of whole trajectories
that are right they share three quarters and more; one that drifts away from its beginning touches new places for ever.
"""

_MOST_STRAYS = 0.05
"""Share of the contacts that are put aside at most: of two objects in one log many more do not fit."""


@dataclass(frozen=True)
class Step:
    """Grasps before and from a step on.

    Attributes:
        grasp: the first one after it, from 0.
        gain_nats: by which the evidence of all exceeds that of both parts, for each contact of the smaller one.
        shared: share of the smaller part's contacts near contacts of the other.
        grasps: number of grasps of the shorter part.
    """

    grasp: int
    gain_nats: float
    shared: float
    grasps: int


def exchanged(contact_map: ContactMap) -> list[Doubt]:
    """The doubt that another object was touched from some grasp on, or that nothing ties two parts together."""
    steps = _steps(_without_strays(contact_map))
    worst = min(steps, key=lambda step: step.gain_nats, default=None)
    if worst is None or worst.gain_nats >= LEAST_nats:
        return loose(steps)
    if worst.shared < _LEAST_SHARED:
        words = (
            f"nothing that was touched before was touched again from grasp {worst.grasp + 1} on: is it another object, "
            "or was it moved?"
        )
    else:
        words = f"contacts before and from grasp {worst.grasp + 1} on do not fit each other: is it another object?"
    return [Doubt("other-object", words, tuple(range(worst.grasp, len(contact_map.placed))))]


def loose(steps: list[Step]) -> list[Doubt]:
    """The doubt that two parts of the trajectory hardly share a place of the object."""
    long_enough = [step for step in steps if step.grasps >= _LOOSE_GRASPS]
    loosest = min(long_enough, key=lambda step: step.shared, default=None)
    if loosest is None or loosest.shared >= _LOOSE_SHARED:
        return []
    words = (
        f"only {loosest.shared:.0%} of the contacts before or from grasp {loosest.grasp + 1} on are near the others: "
        "how the two parts lie to each other rests on the hand's motion alone"
    )
    return [Doubt("loose-parts", words, (loosest.grasp,))]


def _without_strays(contact_map: ContactMap) -> ContactMap:
    """The map without a few contacts that its field does not explain, the worst first.

    A pair of wrong contacts that flat faces put up with costs a field of all contacts as much as another object does;
    fields of the parts, with one of the pair each, bulge there at little cost.
    """
    for _ in range(int(_MOST_STRAYS * len(contact_map.contacts))):
        costs = contact_map.fit().leave_one_out_costs(np.arange(len(contact_map.contacts)))
        if costs.max() <= UNEXPLAINED_COST:
            break
        contact_map = contact_map.without_contact(*contact_map.origins[int(costs.argmax())])
    return contact_map


def _steps(contact_map: ContactMap) -> list[Step]:
    """Every step with enough grasps on both sides whose contacts count."""
    used = [index for index, grasp in enumerate(contact_map.placed) if grasp.used]
    found = []
    for step in range(_LEAST_GRASPS, len(used) - _LEAST_GRASPS + 1):
        before, after = used[max(0, step - _MOST_GRASPS) : step], used[step : step + _MOST_GRASPS]
        found.append(_step(contact_map, before, after))
    return found


def _step(contact_map: ContactMap, before: list[int], after: list[int]) -> Step:
    parts = [_part(contact_map, before), _part(contact_map, after)]
    smaller, larger = sorted((part.contacts for part in parts), key=len)
    gain = _evidence(_part(contact_map, before + after)) - sum(_evidence(part) for part in parts)
    return Step(after[0], gain / len(smaller), _share_near(smaller, larger), min(len(before), len(after)))


def _part(contact_map: ContactMap, grasps: list[int]) -> ContactMap:
    placed = tuple(contact_map.placed[grasp] for grasp in grasps)
    return replace(contact_map, placed=placed, archive=(), settled_cost=0.0)


def _evidence(contact_map: ContactMap) -> float:
    return contact_map.fit().log_marginal_likelihood()


def _share_near(contacts: ContactSet, others: ContactSet) -> float:
    """Share of contacts that have one of the others near, on a side that faces the same way."""
    near = cKDTree(others.points_m).query_ball_point(contacts.points_m, _NEAR_m)
    least = np.cos(_LARGEST_ANGLE_rad)
    alike = [
        bool((others.normals[found] @ normal > least).any())
        for found, normal in zip(near, contacts.normals, strict=True)
    ]
    return float(np.mean(alike))
