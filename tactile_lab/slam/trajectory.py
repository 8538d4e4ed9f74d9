"""The estimated poses of all grasps of a session, and how certain they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from tactile_lab.slam.doubt.spread import spread_by
from tactile_lab.slam.doubt.status import Alternative
from tactile_lab.slam.tracking.contacts.contact_map import PlacedGrasp
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.tracker import Tracker

_Entry = TypeVar("_Entry")


@dataclass(frozen=True)
class Trajectory:
    """One entry for each grasp, in order; None before the object frame was defined.

    Attributes:
        tracker: has the poses of the last grasps; None if no object frame was ever defined.
        grasps: number of all grasps.
        origin_height_m: height of the object frame's origin over the table.
    """

    tracker: Tracker | None
    grasps: int
    origin_height_m: float

    @property
    def poses(self) -> tuple[Pose3 | None, ...]:
        """``world_T_object``."""
        if self.tracker is None:
            return (None,) * self.grasps
        space = self.tracker.refined.space
        return tuple(None if grasp is None else space.pose(grasp.pose, self.origin_height_m) for grasp in self._placed)

    @property
    def covariances(self) -> tuple[Array | None, ...]:
        """Of the pose vectors, in the object frame of the first grasp."""
        return tuple(None if grasp is None else grasp.covariance for grasp in self._placed)

    @property
    def common_covariances(self) -> tuple[Array | None, ...]:
        """The same in the object frame in which all grasps agree best; empty for methods but "joint"."""
        if not isinstance(self.tracker, JointTracker):
            return ()
        return self._of_all(list(self.tracker.common_covariances))

    def covariances_with(
        self, others: Sequence[Alternative]
    ) -> tuple[tuple[Array | None, ...], tuple[Array | None, ...]]:
        """:attr:`covariances` and :attr:`common_covariances` with what alternatives add to them."""
        stated = self.covariances, self.common_covariances
        if not others or self.tracker is None:
            return stated
        spread = spread_by(others, self.tracker.refined)
        return self._sums(stated[0], spread.birth), self._sums(stated[1], spread.common)

    @property
    def _placed(self) -> tuple[PlacedGrasp | None, ...]:
        return self._of_all(() if self.tracker is None else self.tracker.refined.placed)

    def _of_all(self, last: Sequence[_Entry]) -> tuple[_Entry | None, ...]:
        """Entries of the last grasps, with those before them."""
        return (*[None] * (self.grasps - len(last)), *last)

    def _sums(self, stated: Sequence[Array | None], added: Array) -> tuple[Array | None, ...]:
        """Covariances with what is added to those of the last grasps, shape (k, size, size)."""
        more = self._of_all(list(added))
        return tuple(
            each if each is None or plus is None else np.asarray(each + plus)
            for each, plus in zip(stated, more, strict=False)
        )
