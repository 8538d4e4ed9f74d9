"""Grasps and touches from beside an object, in a session whose grasps come from above where they can."""

from __future__ import annotations

from drivers.core.contacts import Grasp
from drivers.shadow.closing.posture import HandShape
from sessions.conductor.estimator import Change, Search
from sessions.motion.cycle_settings import TouchSettings
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.probing.room import Room
from tactile_lab.autonomy.estimated_object import EstimatedObject
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner
from tactile_lab.autonomy.standing.candidate import SideReach
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.planner import StandingPlanner

_BLOCKED_FROM_ABOVE = 2
"""Approaches in a row; then, in space, the hand touches, or comes from the side."""

HIGHEST_FROM_ABOVE_m = 0.08
"""Taller objects are grasped from the side: the knuckles would land on them."""


class Beside:
    """Plans for an object that is too tall to pass over, or that blocked the way down.

    What is too tall, or wider than the hand opens, stays where it stands from then on. Otherwise one grasp or touch is
    captured from beside, if one is possible; then grasps come from above again.

    Args:
        rule: knows where the object is, and how tall, without an estimate.
        estimate: of the object.
        room: knows where the hand has landed.
        hand: its form, and the shape of its fingertips.
        reach: of the palm.
        touches: how the hand touches without grasping; None if it shall not.
        surface: a surface is wanted, not an outline: what blocks the way down is met from beside.
    """

    def __init__(
        self,
        rule: HeuristicPlanner,
        estimate: EstimatedObject,
        room: Room,
        hand: HandShape,
        reach: SideReach,
        touches: TouchSettings | None,
        surface: bool,
    ) -> None:
        self._rule, self._estimate, self._room = rule, estimate, room
        self._hand, self._reach, self._touches, self._surface = hand, reach, touches, surface
        self._planner: StandingPlanner | None = None
        self._for_once = False
        self.blocked = 0
        """Approaches in a row that were blocked."""
        self.exhausted = ""
        """Why no action is left, in words; empty while there is one."""
        self.search: Search | None = None
        """How to look for the object before anything else; None where it is believed where it was."""

    @property
    def is_on(self) -> bool:
        """Whether the object is grasped and touched from beside now."""
        return self._planner is not None

    def plan(self, index: int) -> GraspPlan | None:
        """The plan of grasp number ``index``; None where it comes from above."""
        if self._planner is None and self._surface and self.blocked >= _BLOCKED_FROM_ABOVE:
            self._planner = self._for_object()
            self._for_once = not self._planner.felt.is_wide
        if self._planner is None:
            return None
        self.search = self._planner.whereabouts.search()
        if self.search is not None:
            return self._rule.plan(index)
        plan = self._planner.plan()
        if plan is None and self._for_once:
            self.return_above()
            return None
        self.exhausted = "" if plan is not None else self._planner.exhausted
        return plan or self._rule.plan(index)

    def replan(self, index: int) -> GraspPlan:
        """Another plan for the same grasp, after a person has vetoed the last one."""
        assert self._planner is not None
        self._planner.on_blocked()
        return self.plan(index) or self._rule.plan(index)

    def touch(self) -> GraspPlan | None:
        """A touch from beside, of an object that is otherwise grasped from above; None if none is possible."""
        return self._for_object().touch()

    def begin(self, box: BoundingBox, searches: int = 0) -> None:
        """The object was felt, and stays where it stands if it is too tall to pass over.

        Args:
            box: as it was felt.
            searches: how often it has been looked for.
        """
        if (box.top_m or 0.0) > HIGHEST_FROM_ABOVE_m:
            self._planner = self._for_object(box, searches)

    def return_above(self) -> None:
        """Grasps come from above again."""
        self._planner, self._for_once, self.blocked = None, False, 0

    def _for_object(self, box: BoundingBox | None = None, searches: int = 0) -> StandingPlanner:
        """For the object as it was felt; without a box by the contacts of the estimate."""
        felt = FeltObject(box) if box is not None else self._felt_object()
        touches, window_rad = self._touches if self._surface else None, self._rule.settings.yaw_window_rad
        return StandingPlanner(felt, self._hand, window_rad, self._reach, touches, searches)

    def _felt_object(self) -> FeltObject:
        top_m = self._rule.top_m or HIGHEST_FROM_ABOVE_m
        felt = FeltObject.around(self._rule.centre_m, top_m, *self._estimate.contacts_world())
        felt.on_landings(self._room.landings_m)
        return felt

    # --- what happened -----------------------------------------------------------------------------------------

    def on_landings(self) -> None:
        """The way down was blocked."""
        self.blocked += 1
        if self._planner is not None:
            self._planner.on_blocked()

    def on_grasp(self, grasp: Grasp) -> None:
        """A grasp or touch was captured."""
        self.blocked = 0
        if self._planner is not None:
            self._planner.on_grasp(grasp)
            self._rule.centre_m = self._planner.middle_m
            if self._for_once:
                self.return_above()

    def on_estimate(self, is_placed: bool) -> None:
        """The last grasp has been estimated, and its contacts were registered or not."""
        if self._planner is not None:
            estimate = self._estimate
            self._planner.on_estimate(is_placed, *estimate.contacts_world(), estimate.motion_world())
            self._rule.centre_m = self._planner.middle_m

    def judge(self, box: BoundingBox) -> tuple[Change, str, int]:
        """What has become of an object that was looked for and met, also in words, and how often it was looked for."""
        assert self._planner is not None
        known, self.search = self._planner.whereabouts, None
        change = known.judge(box)
        return change, known.in_words(change, box, self._planner.felt.grasps), known.searches
