"""Trackers that take a pose as it comes: from the hand's motion alone, or from outside.

They are the two ends that every method is measured between: odometry is what the hand's motion is worth without any
touch, and known poses show what the shape model makes of perfect tracking.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gtsam import Pose3

from tactile_lab.geometry.contacts import Array
from tactile_lab.geometry.poses import planar
from tactile_lab.tracking.contact_map import ContactMap, PlacedGrasp
from tactile_lab.tracking.contact_set import ContactSet, planar_rotation
from tactile_lab.tracking.motion import MotionNoise, compose, inverse, pose_row
from tactile_lab.tracking.particle_filter import PoseEstimate

KNOWN_COVARIANCE = np.diag([1e-10, 1e-10, 1e-10])
"""A pose that is given is certain up to rounding."""


class OdometryTracker:
    """Eq. 3.8 and nothing else: the object moved as the hand did, and the uncertainty adds up."""

    effective_count = 1.0

    def __init__(self, first: ContactMap, noise: MotionNoise) -> None:
        self._map, self._noise = first, noise
        self._motion, self._trusted = np.zeros(3), True
        self._now = PoseEstimate(first.placed[-1].row, first.placed[-1].covariance)

    @property
    def map(self) -> ContactMap:
        return self._map

    def predict(self, motion: Array) -> None:
        """Carry the pose along; its covariance turns with it, and the noise is added."""
        self._motion = motion
        turn = np.eye(3)
        turn[:2, :2] = planar_rotation(motion[2])
        covariance = turn @ self._now.covariance @ turn.T + np.diag(self._noise.sigmas**2)
        self._now = PoseEstimate(compose(motion, self._now.row), covariance)

    def weigh(self, contacts: ContactSet) -> bool:
        self._trusted = len(contacts) > 0
        return self._trusted

    def estimate(self) -> PoseEstimate:
        return self._now

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        """Contacts enter the shape where the pose puts them, however uncertain: a baseline judges nothing."""
        placed = PlacedGrasp(contacts, self._now.row, self._now.covariance, self._motion)
        self._map = self._map.with_grasp(placed if self._trusted else placed.put_aside())

    def resample(self) -> None:
        """There is one belief only."""

    def adopt(self, corrected: ContactMap) -> None:
        self._map = corrected
        self._now = PoseEstimate(corrected.placed[-1].row, corrected.placed[-1].covariance)

    def finish(self) -> None:
        """Nothing is estimated, so nothing is left to improve."""


class KnownPoseTracker(OdometryTracker):
    """Places every grasp at a pose that is given: the floor that tracking can not go below."""

    def __init__(self, first: ContactMap, noise: MotionNoise, poses: Sequence[Pose3 | None]) -> None:
        """
        Args:
            first: map of the first grasp.
            noise: how the uncertainty grows over grasps whose pose is not known.
            poses: true ``world_T_object`` of the first grasp, which is known, and of all that follow; in the truth's
                own object frame, which the first grasp ties to the map's.
        """
        super().__init__(first, noise)
        known = [None if pose is None else pose_row(planar(pose)) for pose in poses]
        assert known[0] is not None
        truth_T_map = compose(inverse(known[0]), first.placed[-1].row)
        self._ahead = [None if row is None else compose(row, truth_T_map) for row in known[1:]]
        self._given: Array | None = None

    def predict(self, motion: Array) -> None:
        super().predict(motion)
        self._given = self._ahead.pop(0) if self._ahead else None
        if self._given is not None:
            self._now = PoseEstimate(self._given, KNOWN_COVARIANCE)

    def weigh(self, contacts: ContactSet) -> bool:
        """Grasps whose pose is not known stay out of the shape."""
        self._trusted = self._given is not None and len(contacts) > 0
        return self._trusted
