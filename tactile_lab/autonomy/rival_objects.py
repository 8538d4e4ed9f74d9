"""The object as it is if an alternative to the estimate is right: what a policy compares its grasps by."""

from __future__ import annotations

from collections.abc import Sequence

from gtsam import Pose3

from drivers.core.errors import ShapeError
from drivers.core.poses import planar
from tactile_lab.autonomy.variance_planner import ExplorationSettings, extract_surface
from tactile_lab.slam.doubt.status import Alternative
from tactile_lab.slam.exploration.policy import RivalObject, Surface
from tactile_lab.slam.tactile_slam import TactileSlam

_MOST = {2: 2, 3: 1}
"""So many are compared, the most likely ones, by the dimension: in space a surface takes a second."""


def rival_objects(
    slam: TactileSlam, alternatives: Sequence[Alternative], hand_motion_world: Pose3, settings: ExplorationSettings
) -> tuple[RivalObject, ...]:
    """Shape and expected pose under each of the most likely alternatives whose contacts enclose something.

    Args:
        slam: the estimation.
        alternatives: to its present estimate, the most likely first.
        hand_motion_world: how the hand has carried the object since the last grasp.
        settings: resolutions.
    """
    found: list[RivalObject] = []
    for one in alternatives:
        contact_map = slam.displaced(one)
        if len(found) == _MOST[contact_map.dimension]:
            break
        try:
            surface = Surface.of(extract_surface(contact_map.fit(), contact_map.dimension, settings))
        except ShapeError:
            continue
        pose = contact_map.space.pose(contact_map.rows[-1], slam.origin_height_m)
        moved = sum(len(contact_map.placed[grasp].kept) for grasp in one.grasps)
        found.append(RivalObject(surface, planar(hand_motion_world * pose), one.probability, moved))
    return tuple(found)
