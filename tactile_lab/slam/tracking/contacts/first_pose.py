"""Where the object frame is born: at the first grasp, by the hand that holds it (section 3.4)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import palm_heading
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL


def first_row(grasp: Grasp, contacts: ContactSet, *, on_table: bool) -> Array:
    """The pose of the object frame at its birth: at the contacts' centre, along the palm."""
    if on_table:
        return np.array([*contacts.points_m[:, :2].mean(axis=0), palm_heading(grasp.world_T_palm)])
    return SPATIAL.row(Pose3(grasp.world_T_palm.rotation(), contacts.points_m.mean(axis=0)))
