"""Trackers with a given pose: from the hand's motion alone, or from outside.

They are the bounds for every method: odometry uses only the hand's motion, and known poses show the shape model with
perfect tracking.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.filter.particle_filter import CERTAIN_VARIANCE, PoseEstimate
from tactile_lab.slam.tracking.joint.deferred_association import CLEARLY_nats
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer
from tactile_lab.slam.tracking.joint.proposals import UNEXPLAINED_COST

_STEP = 1e-6
_LOOKS = 3
_KERNEL_EVERY = 4
"""Kernel parameters are estimated again after this many grasps."""


class OdometryTracker:
    """Only eq. 3.8: the object moved as the hand did, and the uncertainty adds up."""

    effective_count = 1.0

    def __init__(self, first: ContactMap, noise: MotionNoise) -> None:
        self._map, self._noise = first, noise
        self._motion, self._trusted = np.zeros(first.space.size), True
        self._motion_sigma: StepSigma | None = None
        self._now = PoseEstimate(first.placed[-1].pose, first.placed[-1].covariance)

    @property
    def map(self) -> ContactMap:
        return self._map

    @property
    def refined(self) -> ContactMap:
        return self._map

    def predict(self, motion: Array, measured: StepSigma | None = None) -> None:
        """Carry the pose along; its covariance goes with it, and the noise is added."""
        space, row = self._map.space, self._now.pose
        moved = space.compose(motion, row)
        by_row = space.deviation(space.compose(motion, row + _STEP * np.eye(space.size)), moved).T / _STEP
        noise = self._noise if measured is None else self._noise.after(motion, measured)
        covariance = by_row @ self._now.covariance @ by_row.T + np.diag(space.sigmas(noise) ** 2)
        self._motion_sigma = measured
        self._motion, self._now = motion, PoseEstimate(moved, covariance)

    def weigh(self, contacts: ContactSet) -> bool:
        self._trusted = len(contacts) > 0
        return self._trusted

    def estimate(self) -> PoseEstimate:
        return self._now

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        """Contacts are added to the shape at the pose, however uncertain it is: a baseline rejects nothing."""
        now, sigma = self._now, self._motion_sigma
        placed = PlacedGrasp(contacts, now.pose, now.covariance, self._motion, motion_sigma=sigma)
        self._map = self._map.with_grasp(placed if self._trusted else placed.put_aside())

    def resample(self) -> None:
        """Nothing to do: there is only one belief."""

    def adopt(self, corrected: ContactMap) -> None:
        self._map = corrected
        self._now = PoseEstimate(corrected.placed[-1].pose, corrected.placed[-1].covariance)

    def finish(self) -> None:
        """Nothing to do: nothing is estimated."""


class KnownPoseTracker(OdometryTracker):
    """Places every grasp at a given pose: the lower bound of tracking errors."""

    def __init__(self, first: ContactMap, noise: MotionNoise, poses: Sequence[Pose3 | None]) -> None:
        """
        Args:
            first: map of the first grasp.
            noise: growth of the uncertainty over grasps with unknown pose.
            poses: true ``world_T_object`` of the first grasp, which is known, and of all that follow; in the truth's
                own object frame, which the first grasp relates to the map's.
        """
        super().__init__(first, noise)
        space, start = first.space, poses[0]
        assert start is not None
        truth_T_map = start.inverse() * space.pose(first.placed[-1].pose, 0.0)
        self._ahead = [None if pose is None else space.motion(pose * truth_T_map) for pose in poses[1:]]
        self._given: Array | None = None
        self._scorer = HypothesisScorer(noise, UNEXPLAINED_COST)

    def predict(self, motion: Array, measured: StepSigma | None = None) -> None:
        super().predict(motion, measured)
        self._given = self._ahead.pop(0) if self._ahead else None
        if self._given is not None:
            self._now = PoseEstimate(self._given, CERTAIN_VARIANCE * np.eye(len(self._given)))

    def weigh(self, contacts: ContactSet) -> bool:
        """Grasps with unknown pose are not used for the shape."""
        self._trusted = self._given is not None and len(contacts) > 0
        return self._trusted

    def update_shape(self, contacts: ContactSet, certain: bool) -> None:
        """Contacts that fit nothing are left out: at known poses they must be wrong."""
        super().update_shape(contacts, certain)
        self._map, _ = self._scorer.clean(self._map, len(self._map.placed) - 1)
        if len(self._map.placed) % _KERNEL_EVERY == 0:
            self._map = self._map.with_best_kernel()

    def finish(self) -> None:
        """Test all contacts again with the final shape; leaving some out changes the kernel.

        The initial kernel is that of the accepted contacts: wrong ones would shorten it to explain all. That of all
        contacts is taken where it is clearly more likely: what lies behind a thin wall does not fit a long one.
        """
        every = self._map.with_all_contacts()
        found = self._tested(replace(every, settings=self._map.with_best_kernel().settings))
        if found.map.left_out_count:
            again = self._tested(every.with_best_kernel())
            found = again if again.cost < found.cost - CLEARLY_nats else found
        self._map = found.map
        for _ in range(_LOOKS):
            seen = self._map.left_out_count
            self._map = FacetedScorer(self._scorer, self._noise).without_errors(self._map.with_best_kernel())
            if self._map.left_out_count == seen:
                break

    def _tested(self, contact_map: ContactMap) -> Hypothesis:
        """The map without contacts that do not fit its kernel."""
        return self._scorer.score(self._scorer.clean(contact_map)[0].with_best_kernel())
