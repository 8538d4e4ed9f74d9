"""The planner: chooses every grasp of a session, by the estimate if there is one, otherwise by the fixed rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar
from drivers.shadow.closing.closing import Closing, closing
from drivers.shadow.closing.posture import HandShape
from sessions.conductor.estimator import Change, Reorientation, Search
from sessions.motion.cycle_settings import TouchSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.probing.room import Room
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.clearance.felt_outline import FeltOutline
from tactile_lab.autonomy.estimated_object import EstimatedObject
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings, contact_centre
from tactile_lab.autonomy.policy_choice import Choice, Knowledge, PolicyChooser
from tactile_lab.autonomy.standing.beside import Beside
from tactile_lab.autonomy.standing.candidate import SideReach
from tactile_lab.autonomy.standing.empty_closings import EmptyClosings
from tactile_lab.autonomy.standing.planner import Standstill
from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape, choose_grasp
from tactile_lab.slam.doubt.assessment import Assessment
from tactile_lab.slam.tactile_slam import TactileSlam

_UPWARD = 0.7
"""Least vertical part of the normal of a contact on the object's top."""

_LEAST_BY_POLICY = 2
"""With fewer contacts than this the object is not where it was expected."""
_BLOCKED_AT_HEIGHT = 3
"""So many approaches in a row must be blocked before an outline is felt higher: pinched near its top, an object is hard
to lift.
"""


class Planner:
    """Chooses grasps, and how to carry the object afterwards.

    Args:
        slam: the estimation.
        rule: plans where there is no estimate.
        exploration: the candidates of the estimate.
        fixed_grasps: this many first grasps follow the rule.
        hand: its form, and the shape of its fingertips.
        dimension: the estimation's, 2 or 3.
        chooser: the policy that chooses if there is an estimate; None for the reward of equation 4.20 alone.
        grasps: number of grasps of the session, for the policy.
        reach: of the palm, for grasps from the side.
        touches: how the hand touches without grasping; None if it shall not.
    """

    def __init__(
        self,
        slam: TactileSlam,
        rule: HeuristicPlanner,
        exploration: ExplorationSettings,
        fixed_grasps: int,
        hand: HandShape,
        dimension: int,
        chooser: PolicyChooser | None = None,
        grasps: int | None = None,
        reach: SideReach | None = None,
        touches: TouchSettings | None = None,
    ) -> None:
        self._slam, self._rule, self._exploration = slam, rule, exploration
        self._fixed_grasps, self._hand, self._dimension = fixed_grasps, hand, dimension
        self._object = EstimatedObject(slam, exploration, dimension)
        self._room, self._felt = Room(hand), FeltOutline(hand)
        self._by_estimate = False
        self._doubted = False
        self._chooser, self._grasps = chooser, grasps
        self._here: GraspFrame | None = None
        self._carried = HandMotion()
        self._touches = touches
        self._beside = Beside(
            rule, self._object, self._room, hand, reach or SideReach(), touches, surface=dimension == 3
        )
        self._standstill, self._empty = Standstill(), EmptyClosings()
        self._outline_m = 0.0
        """Where the hand had no room for an outline as low as it was planned: least height of its contacts now."""

        self.choice: Choice | None = None
        """The policy's decision about the next grasp; None if the policy was not asked."""

    @property
    def centre_m(self) -> Array:
        """Estimated centre of the object, world x, y."""
        return self._rule.centre_m

    @property
    def exhausted(self) -> str:
        """Why no action is left, in words; empty while there is one."""
        return self._beside.exhausted

    @property
    def search(self) -> Search | None:
        """How to look for the object before anything else; None where it is believed where it was."""
        return self._beside.search

    @property
    def settings(self) -> PlanSettings:
        """What may be grasped."""
        return self._rule.settings

    # --- the next grasp ----------------------------------------------------------------------------------------

    def plan(self, index: int) -> GraspPlan:
        """Plan grasp number ``index``, from 0, clear of all places where the hand has landed on the object.

        After a grasp that the estimate had chosen and that missed the object with some fingers, one grasp follows the
        contacts alone.
        """
        return self._beside.plan(index) or self._with_room_for_links(self._from_above(index))

    def _with_room_for_links(self, plan: GraspPlan) -> GraspPlan:
        """The plan at least as high as the outline is felt; higher only once other ways down to it were blocked."""
        may_rise = self._dimension == 3 or self._beside.blocked >= _BLOCKED_AT_HEIGHT
        return replace(plan, height_m=max(plan.height_m, self._outline_m), may_rise=may_rise)

    def _from_above(self, index: int) -> GraspPlan:
        trusted, self.choice = index >= self._fixed_grasps and not self._doubted, None
        if self._touches is not None and (again := self._empty.next(self._rule.fitting_heights_m)) is not None:
            self._by_estimate = False
            return again
        if self._standstill.is_reached and (touch := self._beside.touch()) is not None:
            self._standstill = Standstill()
            return touch
        if trusted and self._chooser is not None:
            return self._by_policy(index, self._chooser)
        chosen = self._best_by_estimate(index) if trusted else None
        self._by_estimate = chosen is not None
        return self._by_rule(index) if chosen is None else replace(chosen, tap=self._rule.taps(index))

    def _by_rule(self, index: int) -> GraspPlan:
        plan = self._rule.plan(index, self._room.has, self._is_clear)
        return replace(plan, tap=self._rule.taps(index))

    def _is_clear(self, plan: GraspPlan) -> bool:
        """Whether the links are, of what was felt."""
        return self._felt.is_clear(plan, self._rule.expected_top_m)

    def replan(self, index: int) -> GraspPlan:
        """Another plan for the same grasp, after a person has vetoed the last one."""
        return self._beside.replan(index) if self._beside.is_on else self._with_room_for_links(self._other(index))

    def _other(self, index: int) -> GraspPlan:
        if self.choice is None or self.choice.decision.chosen is None:
            plan = self._by_rule(index)
            return replace(plan, reason=f"{plan.reason}, as the last was vetoed")
        self.choice = self.choice.without_chosen()
        return self._plan_of(self.choice, index)

    def _by_policy(self, index: int, chooser: PolicyChooser) -> GraspPlan:
        """The policy's choice; the fixed rule if it has none, or without an estimate."""
        knowledge = self._knowledge(index)
        if knowledge is None:
            self._by_estimate = False
            return self._by_rule(index)
        self.choice = chooser.choose(index + 1, knowledge, self._room.has)
        return self._plan_of(self.choice, index)

    def _plan_of(self, choice: Choice, index: int) -> GraspPlan:
        plan, self._by_estimate = choice.plan, choice.plan is not None
        knowledge = self._knowledge(index)
        if plan is not None and self._chooser is not None and knowledge is not None:
            self._chooser.on_decision(choice, knowledge)
            return plan
        rule = self._by_rule(index)
        return replace(rule, reason=f"{rule.reason}, as {choice.decision.reason}")

    def _knowledge(self, index: int) -> Knowledge | None:
        known, expected, covariance = (
            self._object.known_shape(),
            self._object.expected_pose(),
            self._slam.pose_covariance,
        )
        if known is None or expected is None or covariance is None or self._chooser is None:
            return None
        left = None if self._grasps is None else self._grasps - index
        spread = self._chooser.spread(covariance, self._carried)
        return Knowledge(known, expected, spread, self._slam.surface_grasps, left, self._here, self._object.rivals())

    def on_bounding_box(self, box: BoundingBox) -> None:
        """Note the bounding box: the object is in its middle, and open fingers keep out of it.

        It is used until the estimate takes over: every time the object is carried it slips within the box.
        """
        if box.top_m is not None:
            self._on_heights(top_m=box.top_m)
        if not box.has_sides:
            return
        self._room.box = box
        if box.is_found:
            self._rule.centre_m = box.centre_world_m
        self._beside.begin(box)

    def on_found_again(self, box: BoundingBox) -> tuple[Change, str]:
        """Note where the object is that was looked for. Returns what has become of it, also in words."""
        change, words, searches = self._beside.judge(box)
        if change is Change.FELL:
            self._begin_anew(box)
        if change is not Change.STANDS:
            self._felt.begin_anew()
            self._beside.begin(box, searches)
        return change, words

    def _begin_anew(self, box: BoundingBox) -> None:
        """Forget what was known of an object that fell over."""
        self._object.is_outdated, self._doubted, self._room.landings_m = True, False, []
        self._beside.return_above()
        self._standstill, self._empty = Standstill(), EmptyClosings()
        self._on_heights(outline_m=0.0)
        if self._chooser is not None:
            self._chooser.begin_anew()
        self.on_bounding_box(box)
        self._rule.centre_m = box.centre_world_m

    def _on_heights(self, top_m: float | None = None, outline_m: float | None = None) -> None:
        """The top was felt, or from which height on the outline can be."""
        self._rule.top_m = self._rule.top_m if top_m is None else top_m
        self._outline_m = self._outline_m if outline_m is None else outline_m
        if self._chooser is not None:
            self._chooser.on_heights(self.settings.as_felt(self._rule.top_m, self._outline_m))

    def on_landings(self, points_world_m: list[Array]) -> None:
        """Note where fingertips landed on the object; used until the object is moved."""
        if points_world_m:
            self._room.on_landings(points_world_m)
            self._empty.on_blocked()
            self._beside.on_landings()

    def _best_by_estimate(self, index: int) -> GraspPlan | None:
        known, expected = self._object.known_shape(), self._object.expected_pose()
        if known is None or expected is None:
            return None
        height_m, settings = self._rule.height_m(index), self._rule.settings

        def table(name: str) -> Closing:
            return closing(name, height_m, self._hand)

        return choose_grasp(
            known, expected, settings.closings, table, settings.yaw_window_rad, self._exploration, self._room.has
        )

    # --- carrying ----------------------------------------------------------------------------------------------

    def on_grasp(self, grasp: Grasp, plan: GraspPlan) -> Reorientation:
        """Note a captured grasp. Returns how to carry the object now."""
        is_beside = self._beside.is_on
        is_raised = not is_beside and plan.height_m > max(self.settings.contour_heights_m)
        if self._dimension == 2 and is_raised and grasp.touching:
            self._on_heights(outline_m=plan.height_m)
        self._beside.on_grasp(grasp)
        if not is_beside and self._dimension == 3 and self._rule.top_m is not None:
            self._empty.on_grasp(grasp, plan)
        if is_beside or plan.only_touch:
            self._object.hand_motion, self._here = Pose3(), plan.frame
            return Reorientation(0.0, np.zeros(2))
        self._felt.on_grasp(grasp)
        least = self._exploration.least_contacts if self._chooser is None else _LEAST_BY_POLICY
        self._doubted = self._by_estimate and len(grasp.touching) < least
        if grasp.touching and (self._doubted or not self._by_estimate):
            self._rule.centre_m = contact_centre(grasp, plan, self._hand.form)
        if tops_m := [float(c.point_world_m[2]) for c in grasp.contacts if c.probed and c.normal_world[2] > _UPWARD]:
            self._on_heights(top_m=max(tops_m))
        turn_rad = self._turn(grasp, plan)
        self._object.hand_motion, self._here = Pose3(), plan.frame
        shift_m = np.zeros(2) if turn_rad is None else self._rule.step_back(self.centre_m)
        return Reorientation(turn_rad or 0.0, shift_m)

    def _turn(self, grasp: Grasp, plan: GraspPlan) -> float | None:
        """How far to turn the object, None to leave it; decided by the policy if there is one."""
        turn_rad = self._rule.turn(plan.frame.yaw_rad)
        if self._chooser is None:
            return turn_rad
        self._chooser.on_grasp(grasp)
        knowledge = self._knowledge(grasp.index) if grasp.index >= self._fixed_grasps else None
        covariance = self._slam.pose_covariance
        if knowledge is None or covariance is None:
            return None if self._chooser.may_leave else turn_rad
        knowledge = replace(knowledge, covariance=covariance)
        return self._chooser.turn(plan.frame, knowledge, grasp, turn_rad, self._room.has)

    def on_carry(self, carried: HandMotion) -> None:
        """Note how the hand carried the object since the last grasp, and how well that is known."""
        self._carried, self._object.hand_motion, motion = carried, carried.world, planar(carried.world)
        self._room.on_carry(carried)
        self._felt.on_carry(motion)
        if self._here is not None:
            pose = motion * Pose2(self._here.x_m, self._here.y_m, self._here.yaw_rad)
            self._here = GraspFrame(float(pose.x()), float(pose.y()), float(pose.theta()))
        self._rule.centre_m = np.asarray(motion.transformFrom(self.centre_m))

    def on_undo(self, hand_motion_world: Pose3) -> None:
        """Note that the last grasp was undone; the motion is the hand odometry since the one before."""
        self._object.hand_motion, self._doubted, self._empty = hand_motion_world, False, EmptyClosings()
        self._felt.begin_anew()

    def on_estimate(self, index: int, is_placed: bool) -> None:
        """Note that grasp number ``index`` has been estimated.

        Args:
            index: of the grasp, from 0.
            is_placed: whether its contacts were registered; if not, a policy must choose another place, or it would try
                the same again.
        """
        self._object.is_outdated = False
        if self._chooser is not None and not is_placed:
            self._chooser.on_unplaced_grasp()
        self._beside.on_estimate(is_placed)
        known, expected = self._object.known_shape(), self._object.expected_pose()
        if known is not None:
            self._standstill.note(known.explored)
        trusted = index + 1 >= self._fixed_grasps and not self._doubted and not self._beside.is_on
        if trusted and known is not None and expected is not None:
            self._room.box = None
            self._rule.centre_m = np.asarray(expected.transformFrom(known.centre_m))

    def known_shape(self) -> KnownShape | None:
        """The present estimate of the shape; None before there is one."""
        return self._object.known_shape()

    def assessment(self) -> Assessment:
        """How far to trust the present estimate."""
        return self._object.assessment()
