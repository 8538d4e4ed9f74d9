"""The planner: chooses every grasp of a session, by the estimate where there is one, else by the fixed rule."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from gtsam import Pose2, Pose3

from drivers.shadow.closing import Closing, closing
from drivers.shadow.posture import TipEllipsoid
from sessions.explorer import ExplorationSettings, KnownShape, choose_grasp, known_shape
from sessions.grasp_cycle import GraspPlan
from sessions.next_grasp import FixedRule, PlanSettings, contact_centre
from tactile_lab.geometry.contacts import FINGERS, Array, Grasp
from tactile_lab.geometry.poses import planar
from tactile_lab.shape.gpis import Gpis
from tactile_lab.slam import TactileSlam

_LANDING_m = 0.020
"""An open fingertip's centre must stay this far from where one has landed on the object."""


@dataclass(frozen=True)
class Reorientation:
    """How to carry the object: turn about the grasp's vertical axis, and shift (2,) along the world's axes."""

    turn_rad: float
    shift_world_m: Array


class Planner:
    """Where to grasp, and how to carry the object then.

    Args:
        slam: the estimation.
        rule: plans where there is no estimate.
        exploration: the candidates of the estimate.
        fixed_grasps: so many grasps follow the rule in any case.
        tip: shape of the fingertips.
        dimension: the estimation's, 2 or 3.
    """

    def __init__(
        self,
        slam: TactileSlam,
        rule: FixedRule,
        exploration: ExplorationSettings,
        fixed_grasps: int,
        tip: TipEllipsoid,
        dimension: int,
    ) -> None:
        self._slam, self._rule, self._exploration = slam, rule, exploration
        self._fixed_grasps, self._tip, self._dimension = fixed_grasps, tip, dimension
        self._known: tuple[Gpis, KnownShape] | None = None
        self._hand_motion = Pose3()
        self._landings_m: list[Array] = []
        self._by_estimate = False
        self._doubted = False

    @property
    def centre_m(self) -> Array:
        """Where the middle of the object is thought to be, world x, y."""
        return self._rule.centre_m

    @property
    def settings(self) -> PlanSettings:
        """What may be grasped."""
        return self._rule.settings

    # --- the next grasp ----------------------------------------------------------------------------------------

    def plan(self, index: int) -> GraspPlan:
        """The grasp number ``index``, from 0, clear of all places where the hand has landed on the object.

        After a grasp that the estimate had chosen and that missed the object with some fingers, the contacts' own
        word counts for one grasp.
        """
        trusted = index >= self._fixed_grasps and not self._doubted
        chosen = self._best_by_estimate(index) if trusted else None
        self._by_estimate = chosen is not None
        return replace(chosen or self._rule.plan(index, self._has_room), tap=self._rule.taps(index))

    def landed(self, points_world_m: list[Array]) -> None:
        """Take note of where fingertips stood on the object; it counts until the object has been moved."""
        self._landings_m += points_world_m

    def _best_by_estimate(self, index: int) -> GraspPlan | None:
        known, expected = self.known_shape(), self._expected_pose()
        if known is None or expected is None:
            return None
        height_m, settings = self._rule.height_m(index), self._rule.settings

        def table(name: str) -> Closing:
            return closing(name, height_m, self._tip)

        return choose_grasp(
            known, expected, settings.closings, table, settings.yaw_window_rad, self._exploration, self._has_room
        )

    def _expected_pose(self) -> Pose2 | None:
        """Where the object is after it was carried; None where it is not known."""
        pose = self._slam.world_T_object
        return None if pose is None or self._slam.is_lost else planar(self._hand_motion * pose)

    def _has_room(self, plan: GraspPlan) -> bool:
        if not self._landings_m:
            return True
        paths = closing(plan.closing, plan.height_m, self._tip).paths
        open_m = [plan.frame.pose.transformFrom(paths[f].centre_m(paths[f].valid[0])) for f in FINGERS]
        apart_m = np.array(open_m)[:, None, :2] - np.array(self._landings_m)[None, :, :2]
        return bool(np.linalg.norm(apart_m, axis=-1).min() >= _LANDING_m)

    # --- carrying ----------------------------------------------------------------------------------------------

    def grasped(self, grasp: Grasp, plan: GraspPlan) -> Reorientation:
        """Take note of a captured grasp; how the object should be carried from there."""
        self._doubted = self._by_estimate and len(grasp.contacts) < self._exploration.least_contacts
        if grasp.contacts and (self._doubted or not self._by_estimate):
            self._rule.centre_m = contact_centre(grasp, plan)
        self._hand_motion = Pose3()
        return Reorientation(self._rule.turn(plan.frame.yaw_rad), self._rule.step_back(self.centre_m))

    def carried(self, hand_motion_world: Pose3) -> None:
        """Take note that the hand carried the object since the last grasp."""
        self._hand_motion, self._landings_m = hand_motion_world, []
        self._rule.centre_m = np.asarray(planar(hand_motion_world).transformFrom(self.centre_m))

    def undone(self, hand_motion_world: Pose3) -> None:
        """Take note that the last grasp was taken back; the hand carried the object so far since the one before."""
        self._hand_motion, self._doubted = hand_motion_world, False

    def estimated(self, index: int) -> None:
        """Take note that grasp number ``index`` has been estimated: from here on its middle may count."""
        known, expected = self.known_shape(), self._expected_pose()
        trusted = index + 1 >= self._fixed_grasps and not self._doubted
        if trusted and known is not None and expected is not None:
            self._rule.centre_m = np.asarray(expected.transformFrom(known.centre_m))

    def known_shape(self) -> KnownShape | None:
        """The shape as estimated now; None before there is one."""
        field = self._slam.surface
        if field is None:
            return None
        if self._known is None or self._known[0] is not field:
            shape = known_shape(field, self._dimension, self._slam.origin_height_m, self._exploration)
            self._known = (field, shape)
        return self._known[1]
