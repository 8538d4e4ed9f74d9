"""Definition of the object frame by the first grasp (section 3.4)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import palm_heading
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL


def first_pose_vector(grasp: Grasp, contacts: ContactSet, *, on_table: bool) -> Array:
    """The initial pose of the object frame: at the contacts' centre, along the palm."""
    if on_table:
        return np.array([*contacts.points_m[:, :2].mean(axis=0), palm_heading(grasp.world_T_palm)])
    return SPATIAL.vector(Pose3(grasp.world_T_palm.rotation(), contacts.points_m.mean(axis=0)))
