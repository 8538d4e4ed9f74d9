"""Trajectory splicing: joins the two halves of a trajectory differently.

A hypothesis that once took a wrong turn carries all later grasps with it: each half of the trajectory is right in
itself, and only the step between them is wrong. Such a step mostly needs an unlikely slip, so that is where to search:
the contacts of the smaller half, as one rigid set, are matched again with the surface of the other half.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost
from tactile_lab.slam.tracking.joint.proposals import ProposalSettings, elsewhere, propose

_UNLIKELY_SIGMA = 2.0
_MOST_STEPS = 4
_KEPT = 3
"""Number of alternatives returned for each step."""

_LEAST_CONTACTS = 3


def splice_trajectories(contact_map: ContactMap, noise: MotionNoise, settings: ProposalSettings) -> list[ContactMap]:
    """The trajectory spliced at its least likely steps.

    Args:
        contact_map: poses and contacts of a hypothesis.
        noise: of the motion model.
        settings: of the search.
    """
    slips = MotionCost.of(contact_map, noise).slips_in_sigma(contact_map.rows).max(axis=1)
    steps = [int(step) + 1 for step in np.argsort(-slips)[:_MOST_STEPS] if slips[step] > _UNLIKELY_SIGMA]
    return [other for step in steps for other in _join_anew(contact_map, step, noise, settings)]


def _join_anew(contact_map: ContactMap, step: int, noise: MotionNoise, settings: ProposalSettings) -> list[ContactMap]:
    """The best alternatives to join the part before a step with the part after it."""
    space, rows, of_grasp = contact_map.space, contact_map.rows, contact_map.grasp_indices
    later = of_grasp >= step
    moves_later = int(later.sum()) <= int((~later).sum())
    moved, anchor, other = (later, step, step - 1) if moves_later else (~later, step - 1, step)
    if min(int(moved.sum()), int((~moved).sum())) < _LEAST_CONTACTS:
        return []
    motion = contact_map.motions[step] if moves_later else space.inverse(contact_map.motions[step])
    submap = contact_map.contacts.select(moved).in_object_frame(space.inverse(rows[anchor]), space)
    field = _half(contact_map, keep_later=not moves_later, step=step).fit()
    found, _ = propose(space.compose(motion, rows[other]), submap, field, noise, settings, space)
    different = found[elsewhere(found, rows[anchor], settings, space)][:_KEPT]
    members = np.arange(len(rows)) >= step if moves_later else np.arange(len(rows)) < step
    return [_turn(contact_map, members, space.compose(space.inverse(rows[anchor]), row)) for row in different]


def _half(contact_map: ContactMap, *, keep_later: bool, step: int) -> ContactMap:
    placed = contact_map.placed[step:] if keep_later else contact_map.placed[:step]
    return replace(contact_map, placed=placed)


def _turn(contact_map: ContactMap, members: NDArray[np.bool_], old_T_new: Array) -> ContactMap:
    """Some grasps' object frames turned, and then all so that the first pose is what it was."""
    space, rows = contact_map.space, contact_map.rows
    rows[members] = space.compose(rows[members], old_T_new)
    gauge = space.compose(space.inverse(rows[0]), contact_map.rows[0])
    turned = space.compose(rows, gauge)
    turned[0] = contact_map.rows[0]  # equal but for rounding
    return contact_map.with_rows(turned)
