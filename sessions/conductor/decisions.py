"""Decision makers of a session: the planner of an autonomous session, or a person.

The conductor asks a decision maker before every grasp and reports the outcome to it. A decision maker moves nothing:
grasps are executed by a performer, which follows the plan by itself or guides a person through it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.errors import TactileLabError
from sessions.conductor.estimator import Change, EstimatorService, PlannedGrasp, PoseStep, Reorientation, Search
from sessions.conductor.estimator_client import EstimatorClient
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.lift import Lift
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.safety import InterruptGuard, SafetySupervisor
from sessions.perception.carrying.forecast import Forecast
from sessions.perception.carrying.slip import Slip
from sessions.perception.hand_odometry import HandMotion


@dataclass(frozen=True)
class DoGrasp:
    """Execute this grasp."""

    plan: GraspPlan


@dataclass(frozen=True)
class UndoGrasp:
    """Undo the last grasp: the estimate returns to the one before, and the grasp does not count."""

    reason: str


@dataclass(frozen=True)
class Wait:
    """No decision yet: run a cycle and ask again."""


@dataclass(frozen=True)
class Pause:
    """While this is the answer, the hand has no demands and the positioner holds."""

    reason: str


@dataclass(frozen=True)
class End:
    """The session is done.

    Attributes:
        reason: why, in words.
        partial: less was done than asked for, as nothing is left that can be.
    """

    reason: str
    partial: bool = False


@dataclass(frozen=True)
class FindAgain:
    """Look for the object before anything else.

    Attributes:
        search: how.
        found: receives what was felt; returns what has become of the object, also in words.
    """

    search: Search
    found: Callable[[BoundingBox], tuple[Change, str]]


Decision: TypeAlias = DoGrasp | UndoGrasp | Wait | Pause | End | FindAgain


@dataclass(frozen=True)
class Veto:
    """A captured grasp that does not count."""

    reason: str


class GraspAbandonedError(Exception):
    """Raised by a performer: the decision maker gave up the current grasp before it was captured."""


class DecisionMaker(Protocol):
    """Decides before each grasp, and receives its outcome. Grasps are numbered from 0."""

    @property
    def centre_m(self) -> Array:
        """Estimated centre of the object, world x, y."""

    @property
    def suggested(self) -> GraspPlan | None:
        """The next grasp, if it is planned already."""

    def prepare(self, index: int) -> None:
        """Prepare the decision about grasp ``index``; may take long while cycles run."""

    def decide(self, index: int) -> Decision:
        """What to do now that grasp ``index`` is next; answers immediately."""

    def on_bounding_box(self, box: BoundingBox) -> None:
        """The object's bounding box was measured."""

    def on_arrival(self, landings_world_m: list[Array]) -> None:
        """The approach has ended; fingertips landed on the object at these points, (3,) each."""

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        """A grasp was measured at ``plan``. Returns how to carry the object now, or why the grasp is discarded."""

    def may_weigh(self, plan: GraspPlan) -> bool:
        """Whether the object held at ``plan`` may be dragged and lifted a little."""

    def on_carry(self, motion: HandMotion) -> None:
        """The hand carried the object since the grasp."""

    def on_estimate(self, step: PoseStep) -> None:
        """The estimation has taken the grasp."""

    def on_undo(self) -> None:
        """The last grasp was undone."""

    def on_failure(self, error: TactileLabError) -> bool:
        """A device failed or a limit was exceeded, and everything stops. Returns whether the session waits and
        continues.
        """


class Performer(Protocol):
    """Executes grasps: the steps of one, in the order in which they are called. See :class:`GraspCycle`."""

    jammed: tuple[str, ...]
    slipped: Slip | None

    @property
    def landings_world_m(self) -> list[Array]: ...
    @property
    def plan(self) -> GraspPlan: ...
    def descend(self, plan: GraspPlan) -> bool: ...
    def close(self) -> None: ...
    def settle(self) -> None: ...
    def capture(self) -> Grasp: ...
    def squeeze(self, touching: frozenset[str]) -> None: ...
    def reorient(self, turn_rad: float, shift_world_m: Array, touching: frozenset[str]) -> Pose3: ...
    def release(self) -> None: ...
    def lift(self) -> None: ...
    def idle(self) -> None: ...


@dataclass(frozen=True)
class SessionRoles:
    """The roles of a session: supervisor, performer, decision maker, estimator client.

    Attributes:
        supervisor: checks every cycle.
        performer: executes the grasps.
        decisions: decides about them.
        estimator: client of estimator and planner; open while the session runs.
        weigh: drags and lifts the object that these fingers hold; None for a session that cannot.
        forecast: predicts a carry by a turn (radians, about the vertical) and a shift (metres, world), and fits the
            force of the fingers to it; None for a session that cannot.
        survey: measures the object's bounding box before the first grasp; its argument returns whether to skip the
            rest. It returns None where a person does without, and is None for a session that cannot.
        find: the same for an object that may not be where it was, with the places and the height of a
            :class:`~sessions.conductor.estimator.Search`.
        guard: receives Ctrl+C while the session runs; code that waits for a person checks it.
    """

    supervisor: SafetySupervisor
    performer: Performer
    decisions: DecisionMaker
    estimator: EstimatorClient
    weigh: Callable[[frozenset[str]], Lift] | None = None
    forecast: Callable[[Grasp, float, Array], Forecast | None] | None = None
    survey: Callable[[Callable[[], bool]], BoundingBox | None] | None = None
    find: Callable[[Callable[[], bool], Array, float | None], BoundingBox] | None = None
    guard: InterruptGuard = field(default_factory=InterruptGuard)


class AutonomousDecisions:
    """The planner decides, and every grasp counts.

    Attributes:
        estimator: client of the planner.
    """

    def __init__(self, estimator: EstimatorClient) -> None:
        self.estimator = estimator
        self._planned: PlannedGrasp | None = None
        """The planner's last decision."""
        self._centre_m: Array | None = None
        """Where the planner expects the object; None after a grasp, until it is asked."""

    @property
    def centre_m(self) -> Array:
        if self._centre_m is None:
            self._centre_m = self.estimator.ask(EstimatorService.centre_m)
        return self._centre_m

    @property
    def suggested(self) -> GraspPlan | None:
        return None if self._planned is None else self._planned.plan

    def prepare(self, index: int) -> None:
        self._planned = self.estimator.ask(EstimatorService.plan, index)

    def decide(self, index: int) -> Decision:
        if self._planned is not None and self._planned.exhausted:
            return End(self._planned.exhausted, partial=True)
        if self._planned is not None and self._planned.search is not None:
            return FindAgain(self._planned.search, self._on_found_again)
        return Wait() if self._planned is None else DoGrasp(self._planned.plan)

    def on_bounding_box(self, box: BoundingBox) -> None:
        self._centre_m = None
        self.estimator.ask(EstimatorService.on_bounding_box, box)

    def _on_found_again(self, box: BoundingBox) -> tuple[Change, str]:
        self._centre_m = None
        return self.estimator.ask(EstimatorService.on_found_again, box)

    def on_arrival(self, landings_world_m: list[Array]) -> None:
        self.estimator.ask(EstimatorService.on_landings, landings_world_m)

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        self._centre_m = None
        return self.estimator.ask(EstimatorService.on_grasp, grasp, plan)

    def may_weigh(self, plan: GraspPlan) -> bool:
        return True

    def on_carry(self, motion: HandMotion) -> None:
        self._centre_m = None
        self.estimator.ask(EstimatorService.on_carry, motion)

    def on_estimate(self, step: PoseStep) -> None:
        self._centre_m = None

    def on_undo(self) -> None:
        self._centre_m = None

    def on_failure(self, error: TactileLabError) -> bool:
        return False
