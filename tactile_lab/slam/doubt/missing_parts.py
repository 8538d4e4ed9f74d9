"""Contacts that the shape does not explain, and that agree with each other: a part such as a handle is missing there.

A contact off the surface may be wrong. Several from different grasps that meet something at the same place, whether the
estimate uses them or not, are evidence that something is there, and so is one far outside that the estimate uses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.shape.selection.unexplained import Unexplained, unexplained
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp

FAR_m = 0.010
"""From the surface to a contact that it does not explain. Errors of contacts and poses together are smaller."""

_TOGETHER_m = 0.025
"""Contacts this close to each other are of one part, which is about two fingertips wide."""

_LEAST_GRASPS = 2
_STRAYS = 3
"""Where so many other contacts lie off the surface, two wrong ones are near each other by chance: one grasp more must
agree, unless the estimate uses a contact there.
"""

ALONE_m = 0.020
"""Outside of the surface: no error of a contact that fits its grasp is so large."""


def missing_parts(contact_map: ContactMap, shape: SurfaceMesh, floor_m: float | None = None) -> list[Doubt]:
    """A doubt for each place where grasps agree on something that the shape does not have, or fills.

    Args:
        contact_map: all grasps at their final poses, with the contacts that are left out.
        shape: object frame.
        floor_m: height of the table under a standing object, object frame; None for an object held free.
    """
    points_m, grasps, kept = _all_contacts(contact_map)
    groups, found = unexplained(points_m, shape, far_m=FAR_m, together_m=_TOGETHER_m), []
    for group in groups:
        concerned = tuple(sorted({int(each) for each in grasps[group.members]}))
        is_used = kept[group.members].any()
        alone = is_used and group.farthest_m > ALONE_m and not group.is_inside
        by_chance = not is_used and sum(len(other.members) for other in groups if other is not group) >= _STRAYS
        if len(concerned) >= _LEAST_GRASPS + by_chance or alone:
            words = _words(points_m[group.members], group, floor_m)
            found.append(Doubt("missing-part", words, concerned, grave=False))
    return found


def _all_contacts(contact_map: ContactMap) -> tuple[Array, NDArray[np.intp], NDArray[np.bool_]]:
    """Contacts of all grasps that have a place, object frame; the number of the grasp of each; which the shape uses."""
    used = [index for index, grasp in enumerate(contact_map.placed) if grasp.used]
    places = [contact_map.contacts_of(index).points_m for index in used]
    kept = [_are_kept(contact_map.placed[index]) for index in used]
    grasps = np.repeat(used, [len(each) for each in places]).astype(np.intp)
    return np.vstack([np.empty((0, 3)), *places]), grasps, np.concatenate([np.zeros(0, dtype=bool), *kept])


def _are_kept(grasp: PlacedGrasp) -> NDArray[np.bool_]:
    return np.isin(np.arange(len(grasp.contacts_world)), grasp.kept)


def _words(points_m: Array, group: Unexplained, floor_m: float | None) -> str:
    x, y = 1e3 * points_m[:, :2].mean(axis=0)
    low, high = 1e3 * (np.array([points_m[:, 2].min(), points_m[:, 2].max()]) - (floor_m or 0.0))
    above = "in the object frame" if floor_m is None else "above the table"
    heights = f"{low:.0f}" if f"{low:.0f}" == f"{high:.0f}" else f"{low:.0f} to {high:.0f}"
    where = f"at x {x:.0f}, y {y:.0f} mm of the model and {heights} mm {above}"
    outside = "outside the model: a part such as a handle or spout is missing there"
    what = "inside the model: a hollow or a gap is filled there" if group.is_inside else outside
    count = f"{len(points_m)} contacts" if len(points_m) > 1 else "a contact"
    lie = "lie up to" if len(points_m) > 1 else "lies"
    return f"{count} {where} {lie} {1e3 * group.farthest_m:.0f} mm {what}"
