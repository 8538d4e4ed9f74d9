"""The object as the estimate has it, for planning: expected pose, known shape, trust and rivals."""

from __future__ import annotations

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import Array
from drivers.core.poses import planar, spatial, transform_points
from tactile_lab.autonomy.rival_objects import rival_objects
from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape, known_shape
from tactile_lab.slam.doubt.assessment import Assessment
from tactile_lab.slam.exploration.policy import RivalObject
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
from tactile_lab.slam.tactile_slam import TactileSlam


class EstimatedObject:
    """Answers from the present estimate, each computed once per estimate.

    Args:
        slam: the estimation.
        exploration: resolution and limits of the known shape.
        dimension: the estimation's, 2 or 3.
    """

    def __init__(self, slam: TactileSlam, exploration: ExplorationSettings, dimension: int) -> None:
        self._slam, self._exploration, self._dimension = slam, exploration, dimension
        self._known: tuple[Gpis, KnownShape] | None = None
        self._assessed: tuple[KnownShape | None, Assessment] | None = None
        self._compared: tuple[tuple[Assessment, Pose3], tuple[RivalObject, ...]] | None = None
        self.hand_motion = Pose3()
        """How the hand carried the object since the last grasp, world frame."""

        self.is_outdated = False
        """The object has fallen over since: nothing of the estimate holds any more."""

    def expected_pose(self) -> Pose2 | None:
        """Pose of the object after it was carried; None if unknown."""
        pose = self._slam.world_T_object
        return None if pose is None or self._slam.is_lost or self.is_outdated else planar(self.hand_motion * pose)

    def contacts_world(self) -> tuple[Array, Array]:
        """Contacts and outward normals of the surface in the world, shape (n, 3) each; none without a surface in space
        at a known pose.
        """
        field, pose = self._slam.surface, self.expected_pose()
        if field is None or pose is None or field.contacts_m.shape[1] == 2:
            return np.empty((0, 3)), np.empty((0, 3))
        world_T_object = spatial(pose, self._slam.origin_height_m)
        points_m = transform_points(world_T_object, field.contacts_m)
        return points_m, field.normals @ world_T_object.rotation().matrix().T

    def motion_world(self) -> Pose2:
        """How it has moved on the table since its first pose that is known; identity where none is."""
        now = self.expected_pose()
        first = None if now is None else next((pose for pose in self._slam.trajectory if pose is not None), None)
        return Pose2() if now is None or first is None else now * planar(first).inverse()

    def known_shape(self) -> KnownShape | None:
        """The present estimate of the shape; None before there is one.

        In space its surface is that of the most probable model, as in the result of a session.
        """
        field = None if self.is_outdated else self._slam.surface
        if field is None:
            return None
        if self._known is None or self._known[0] is not field:
            self._known = (field, self._measure_shape(field))
        return self._known[1]

    def assessment(self) -> Assessment:
        """How far to trust the present estimate."""
        known = self.known_shape()
        if self._assessed is None or known is None or self._assessed[0] is not known:
            self._assessed = known, self._slam.assess(None if known is None else known.extracted)
        return self._assessed[1]

    def rivals(self) -> tuple[RivalObject, ...]:
        """The object by each alternative to the present estimate, after it was carried."""
        key = self.assessment(), self.hand_motion
        if self._compared is None or any(one is not other for one, other in zip(self._compared[0], key, strict=True)):
            found = rival_objects(self._slam, key[0].alternatives, self.hand_motion, self._exploration)
            self._compared = key, found
        return self._compared[1]

    def _measure_shape(self, field: Gpis) -> KnownShape:
        shape = self._slam.shape(self._exploration.mesh_resolution_m) if self._dimension == 3 else None
        mesh = shape if isinstance(shape, SurfaceMesh) else None
        return known_shape(field, self._dimension, self._slam.origin_height_m, self._exploration, mesh)
