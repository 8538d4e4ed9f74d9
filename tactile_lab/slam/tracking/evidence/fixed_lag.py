"""Long sessions: only the last grasps stay open, earlier ones are summarized.

The poses of older grasps are settled. Of their contacts a spread-out selection stays, as one grasp at the last settled
pose, so that the work of a step does not grow with the length of the session.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet

_TURN_LENGTH_m = 0.020
"""Contacts whose normals differ by one radian count as this far apart."""


def condense(contact_map: ContactMap, window: int, remembered: int) -> ContactMap:
    """The map with only the last grasps open.

    Args:
        contact_map: with more grasps than ``window``.
        window: number of grasps that stay open.
        remembered: largest number of contacts kept of all earlier grasps.
    """
    old, recent = contact_map.placed[:-window], contact_map.placed[-window:]
    archived = old[1:] if contact_map.archive else old
    before = replace(contact_map, placed=old)
    seen, last = before.contacts, old[-1]
    back = contact_map.space.inverse(last.pose)
    chosen = seen.select(_spread_out(seen, remembered)).in_object_frame(back, contact_map.space)
    free, _ = contact_map.space.to_object(back, before.free_points_m, before.free_points_m)
    free = _every(free, 2 * remembered)
    world = replace(chosen, free_m=free, free_of=np.full(len(free), -1))
    summary = PlacedGrasp(world, last.pose, last.covariance, np.zeros_like(last.pose))
    return replace(contact_map, placed=(summary, *recent), archive=contact_map.archive + archived)


def unfold(contact_map: ContactMap) -> ContactMap:
    """The map with all its grasps open."""
    if not contact_map.archive:
        return contact_map
    return replace(contact_map, placed=contact_map.archive + contact_map.placed[1:], archive=())


def _spread_out(contacts: ContactSet, count: int) -> NDArray[np.intp]:
    """Indices of contacts far from each other in position and normal (farthest point selection)."""
    places = np.hstack([contacts.points_m, _TURN_LENGTH_m * contacts.normals])
    chosen = [0]
    gaps = np.linalg.norm(places - places[0], axis=1)
    while len(chosen) < min(count, len(places)):
        chosen.append(int(gaps.argmax()))
        gaps = np.minimum(gaps, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.sort(np.array(chosen, dtype=np.intp))


def _every(places: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    return places[:: max(1, -(-len(places) // count))]
