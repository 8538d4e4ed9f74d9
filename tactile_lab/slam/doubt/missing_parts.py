"""Contacts that the shape does not explain, and that agree with each other: a part such as a handle is missing there.

A single contact off the surface may be wrong. Several from different grasps that meet something at the same place,
whether the estimate uses them or not, are evidence that something is there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.status import Doubt
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh, mesh_arrays
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap

FAR_m = 0.010
"""From the surface to a contact that it does not explain. Errors of contacts and poses together are smaller."""

_TOGETHER_m = 0.025
"""Contacts this close to each other are of one part, which is about two fingertips wide."""

_LEAST_GRASPS = 2


def missing_parts(contact_map: ContactMap, shape: SurfaceMesh, floor_m: float | None = None) -> list[Doubt]:
    """A doubt for each place where grasps agree on something that the shape does not have, or fills.

    Args:
        contact_map: all grasps at their final poses, with the contacts that are left out.
        shape: object frame.
        floor_m: height of the table under a standing object, object frame; None for an object held free.
    """
    points_m, grasps = _all_contacts(contact_map)
    if not len(points_m):
        return []
    away_m = distances_to_mesh(points_m, shape)
    far = np.flatnonzero(away_m > FAR_m)
    inside = np.zeros(len(points_m), dtype=bool)
    inside[far] = _are_inside(points_m[far], shape)
    found = []
    for is_inside in (False, True):
        for group in _groups(points_m, far[inside[far] == is_inside]):
            if len(set(grasps[group])) >= _LEAST_GRASPS:
                words = _words(points_m[group], float(away_m[group].max()), floor_m, is_inside=is_inside)
                found.append(Doubt("missing-part", words, tuple(sorted({int(each) for each in grasps[group]})), False))
    return found


def _all_contacts(contact_map: ContactMap) -> tuple[Array, NDArray[np.intp]]:
    """Contacts of all grasps that have a place, object frame, and the number of the grasp of each."""
    used = [index for index, grasp in enumerate(contact_map.placed) if grasp.used]
    places = [contact_map.contacts_of(index).points_m for index in used]
    return np.vstack([np.empty((0, 3)), *places]), np.repeat(used, [len(each) for each in places]).astype(np.intp)


def _are_inside(points_m: Array, shape: SurfaceMesh) -> NDArray[np.bool_]:
    import igl  # here, so that importing this module stays quick

    if not len(points_m):
        return np.zeros(0, dtype=bool)
    winding = igl.fast_winding_number(*mesh_arrays(shape), np.ascontiguousarray(points_m))
    return np.asarray(winding > 0.5)


def _groups(points_m: Array, chosen: NDArray[np.intp]) -> Sequence[NDArray[np.intp]]:
    if len(chosen) < _LEAST_GRASPS:
        return []
    labels = fcluster(linkage(points_m[chosen], "single"), _TOGETHER_m, "distance")
    return [chosen[labels == label] for label in np.unique(labels)]


def _words(points_m: Array, away_m: float, floor_m: float | None, *, is_inside: bool) -> str:
    x, y = 1e3 * points_m[:, :2].mean(axis=0)
    low, high = 1e3 * np.array([points_m[:, 2].min(), points_m[:, 2].max()]) - 1e3 * (floor_m or 0.0)
    above = "in the object frame" if floor_m is None else "above the table"
    where = f"at x {x:.0f}, y {y:.0f} mm of the model and {low:.0f} to {high:.0f} mm {above}"
    outside = "outside the model: a part such as a handle or spout is missing there"
    what = "inside the model: a hollow or a gap is filled there" if is_inside else outside
    return f"{len(points_m)} contacts {where} lie up to {1e3 * away_m:.0f} mm {what}"
