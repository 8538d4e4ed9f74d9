"""Plans for an object that is left where it stands: grasps from the side, and touches where no grasp reaches.

What comes next is what is expected to tell most. So the kind of action changes by itself once one kind has no more to
tell, and the session ends only after every kind has.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from gtsam import Pose2

from drivers.core.contacts import Array, Grasp
from drivers.shadow.closing.closing import closing
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import TouchSettings
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.standing.candidate import SideReach, StandingCandidate, approach_of
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.inside_planner import InsidePlanner
from tactile_lab.autonomy.standing.rim_planner import RimPlanner
from tactile_lab.autonomy.standing.search import Whereabouts
from tactile_lab.autonomy.standing.side_planner import SidePlanner
from tactile_lab.autonomy.standing.touch_planner import TouchPlanner

_GRASPS, _LEAST_GAIN = 3, 0.01

_ROUNDS = 3
"""So often every place is looked for: contacts were found beside some, and the box was known less well."""

_UNSTEADY = (
    "does not stay where it is: it was looked for {searches} times already. Steady it (putty under its foot, more "
    "weight) or lay it down (--pose lying), and start again; {size}"
)


class Standstill:
    """Whether the share of the surface that is known has stopped growing."""

    def __init__(self) -> None:
        self._shares: list[float] = []

    def note(self, explored: float) -> None:
        """The share after one more grasp, 0..1."""
        self._shares.append(explored)

    @property
    def is_reached(self) -> bool:
        """Whether the last three grasps have added less than one part in a hundred."""
        return len(self._shares) > _GRASPS and max(self._shares[-_GRASPS:]) < self._shares[-_GRASPS - 1] + _LEAST_GAIN


@dataclass
class StandingPlanner:
    """Plans around one object.

    Attributes:
        felt: what is known of it.
        hand: its form, and the shape of its fingertips.
        yaw_window_rad: of the arm.
        reach: of the palm.
        settings: of touches; None for none.
        searches: how often the object was looked for before.
    """

    felt: FeltObject
    hand: HandShape
    yaw_window_rad: tuple[float, float]
    reach: SideReach
    settings: TouchSettings | None = None
    searches: int = 0
    _current: StandingCandidate | None = None
    _touches: int = 0
    _blocked: int = 0
    _rounds: int = 1
    whereabouts: Whereabouts = field(init=False)
    _grasping: SidePlanner = field(init=False)
    _touching: TouchPlanner | None = field(init=False)
    _pinching: RimPlanner = field(init=False)
    _reaching_in: InsidePlanner = field(init=False)

    def __post_init__(self) -> None:
        self.whereabouts = Whereabouts(self.felt, self.searches)
        where = (self.felt, self.hand, self.yaw_window_rad, self.reach)
        lowest_m = (self.settings or TouchSettings()).side_heights_m
        self._grasping, self._pinching = SidePlanner(*where, lowest_m), RimPlanner(*where)
        self._reaching_in = InsidePlanner(*where)
        self._touching = None if self.settings is None else TouchPlanner(*where, self.settings)

    def plan(self) -> GraspPlan | None:
        """The next grasp or touch; None where nothing is left that would tell anything new, or it has fallen over."""
        if self.whereabouts.is_given_up:
            return None
        self._current = self._best()
        if self._current is None and self._rounds < _ROUNDS:
            self._rounds += 1
            self.felt.look_again()
            self._current = self._best()
        return None if self._current is None else self._current.plan

    def _best(self) -> StandingCandidate | None:
        """What would tell most; None where nothing would tell anything new."""
        touches = [] if self._touching is None else [self._touching.best(), self._reaching_in.best()]
        offers = [self._grasping.best(), self._pinching.best(), *touches]
        return max((one for one in offers if one), key=lambda one: one.score_m, default=None)

    def touch(self) -> GraspPlan | None:
        """The touch that would tell most; None where none would tell anything new."""
        best = None if self._touching is None else self._touching.best()
        return None if best is None else best.plan

    def on_grasp(self, grasp: Grasp) -> None:
        """Take note of contacts, and of where none was."""
        self.felt.on_grasp(grasp)
        if (done := self._current) is None:
            return
        self._touches += done.plan.only_touch
        self.whereabouts.on_grasp(grasp, done, approach_of(done.plan, self.hand))
        if done.normals is not None:
            self.felt.openings.on_looked(done.touches_m, done.normals)
        else:
            self.felt.on_looked(done.touches_m, on_top=done.on_top)
        if done.plan.only_touch and done.plan.places:
            self.felt.on_pushed(approach_of(done.plan, self.hand))
            self.felt.on_passed(grasp.approach_paths)
        if done.on_top:
            self.felt.on_missed_top(done.touches_m)

    def on_estimate(self, is_placed: bool, points_m: Array, normals: Array, motion: Pose2) -> None:
        """Take note whether the contacts of the last grasp fit what was felt before, and where all are placed by now.

        Args:
            is_placed: whether they fit.
            points_m, normals: of all contacts that the estimate has, shape (n, 3), world frame; perhaps none.
            motion: of the object since its first pose, world frame.
        """
        self.whereabouts.on_estimate(is_placed)
        if is_placed and len(points_m):
            self.felt.place(points_m, normals, motion)

    def on_blocked(self) -> None:
        """Take note that the hand met something on its way."""
        if (tried := self._current) is None:
            return
        self._blocked += 1
        self.whereabouts.on_blocked()
        if not tried.plan.only_touch:
            is_sideways = closing(tried.plan.closing, tried.plan.height_m, self.hand).is_sideways
            (self._grasping if is_sideways else self._pinching).blocked.append(tried)
        elif self._touching is not None:
            self._touching.blocked.append(tried)

    @property
    def middle_m(self) -> Array:
        """Of the object, world x, y."""
        return self.felt.middle_m

    @property
    def exhausted(self) -> str:
        """Why there is nothing else to do, in words."""
        if self.whereabouts.is_given_up:
            told = _UNSTEADY.format(searches=self.whereabouts.searches, size=self.felt.in_words())
            return f"the object {told}{self._thinness}"
        grasps = self.felt.grasps - self._touches
        touches = f", {self._touches} touches" if self._touches else ""
        blocked = f", {self._blocked} approaches were blocked" if self._blocked else ""
        return f"nothing left that the hand can reach: {grasps} grasps{touches}{blocked}; {self.felt.in_words()}"

    @property
    def _thinness(self) -> str:
        """That the object is thinner than a fingertip, in words; empty where it is not."""
        tip_m = 2 * self.hand.radius_m
        is_thin = min(self.felt.standing_box.size_m) < tip_m
        return f", thinner than a fingertip of {1e3 * tip_m:.0f} mm" if is_thin else ""
