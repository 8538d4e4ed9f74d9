"""Checks that no link above the fingertips meets the object while closing: it would push the object, unnoticed.

The hand must come down over tall objects, and its fingers reach down beside long ones, so that knuckles and middle
links may be nearer to the object than the fingertips are. On the simulated rig every grasp that moved an unheld object
by more than 2 mm was of this kind (decision 32).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from gtsam import Pose2
from scipy.spatial import KDTree

from drivers.core.contacts import Array
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.collision_spheres import Verdicts, link_balls
from drivers.shadow.closing.posture import PROGRESS, HandShape
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.slam.exploration.policy import Surface
from tactile_lab.slam.tracking.contacts.contact_set import planar_rotation

_POSTURES = slice(None, None, 2)
_MARGIN_m = 0.001
"""Distances are those to the surface's vertices, which are up to 6 mm apart: correction for this."""


@dataclass(frozen=True)
class StandingObject:
    """An estimated object at its pose on the table.

    Attributes:
        surface: object frame.
        world_T_object: planar pose.
        origin_height_m: height of the object frame's origin over the table.
        top_m: assumed height of an object of which only the contour is known.
    """

    surface: Surface
    world_T_object: Pose2
    origin_height_m: float
    top_m: float

    def distances_m(self, places_world_m: Array) -> Array:
        """Of places (..., 3) to its surface, negative inside, shape (...)."""
        pose = self.world_T_object
        places_m = places_world_m.reshape(-1, 3) - [pose.x(), pose.y(), 0.0]
        places_m[:, :2] = places_m[:, :2] @ planar_rotation(float(pose.theta()))
        if self.surface.points_m.shape[1] == 3:
            found = self._beside(places_m - [0.0, 0.0, self.origin_height_m])
        else:
            beside_m, above_m = self._beside(places_m[:, :2]), places_m[:, 2] - self.top_m
            over = np.hypot(np.maximum(beside_m, 0.0), above_m)
            found = np.where(above_m > 0.0, over, np.maximum(beside_m, above_m))
        return np.asarray(found.reshape(places_world_m.shape[:-1]))

    @cached_property
    def _vertices(self) -> KDTree:
        return KDTree(self.surface.points_m)

    def _beside(self, places_m: Array) -> Array:
        """Distances to the nearest vertices; of places behind those, to the tangent planes."""
        nearest = self._vertices.query(places_m)[1]
        ways_m = places_m - self.surface.points_m[nearest]
        along_m = np.sum(ways_m * self.surface.normals[nearest], axis=1)
        return np.asarray(np.where(along_m > 0.0, np.linalg.norm(ways_m, axis=1), along_m))


def standing(known: KnownShape, world_T_object: Pose2, contour_top_m: float) -> StandingObject | None:
    """The object as estimated; None if the contacts enclose nothing yet."""
    if known.surface is None:
        return None
    return StandingObject(known.surface, world_T_object, known.origin_height_m, contour_top_m)


def links_are_clear(plans: Sequence[GraspPlan], hand: HandShape, target: StandingObject) -> Verdicts:
    """For each plan, whether every finger descends and closes with no link in the object until its tip touches."""
    verdicts = np.empty(len(plans), dtype=bool)
    for kind in {(plan.closing, plan.height_m) for plan in plans}:
        alike = [index for index, plan in enumerate(plans) if (plan.closing, plan.height_m) == kind]
        verdicts[alike] = _are_clear([plans[index] for index in alike], hand, target)
    return verdicts


def _are_clear(plans: Sequence[GraspPlan], hand: HandShape, target: StandingObject) -> Verdicts:
    """The same for plans that differ only in the grasp frame."""
    name, height_m = plans[0].closing, plans[0].height_m
    balls, table = link_balls(name, height_m, hand), closing(name, height_m, hand)
    tips_m = np.array([[table.path(finger).centre_m(u) for finger in table.fingers] for u in PROGRESS[_POSTURES]])
    places_m = np.concatenate([balls.centres_m[_POSTURES], tips_m], axis=1)
    frames = np.array([plan.frame.pose.matrix() for plan in plans])[:, None, None]
    distances_m = target.distances_m((frames[..., :3, :3] @ places_m[..., None])[..., 0] + frames[..., :3, 3])
    links_m, tips_m = np.split(distances_m, [-len(table.fingers)], axis=-1)
    touching = (tips_m < hand.radius_m) & balls.usable[_POSTURES]
    return ~balls.collides(links_m - _MARGIN_m, ~np.logical_or.accumulate(touching, axis=1), _POSTURES)
