"""Where the object frame is born: at the first grasp, by the hand that holds it (section 3.4)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from tactile_lab.geometry.contacts import Array, Grasp
from tactile_lab.tracking.contact_set import ContactSet
from tactile_lab.tracking.spatial_rows import SPATIAL


def first_row(grasp: Grasp, contacts: ContactSet, *, on_table: bool) -> Array:
    """The pose of the object frame at its birth: at the contacts' centre, along the palm."""
    if on_table:
        return np.array([*contacts.points_m[:, :2].mean(axis=0), palm_heading(grasp.world_T_palm)])
    return SPATIAL.row(Pose3(grasp.world_T_palm.rotation(), contacts.points_m.mean(axis=0)))


def palm_heading(world_T_palm: Pose3) -> float:
    """Direction of the palm's horizontal axis in the world, radians.

    The palm's z axis points along the fingers. Where that is close to vertical its x axis, to the thumb's side,
    is used instead.
    """
    axes = world_T_palm.rotation().matrix()
    along = axes[:2, 2] if np.linalg.norm(axes[:2, 2]) > 0.5 else axes[:2, 0]
    return float(np.arctan2(along[1], along[0]))
