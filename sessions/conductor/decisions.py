"""Who decides what a session does next: the planner of an autonomous session, or a person.

The conductor asks a decision maker before every grasp and tells it what came of it. Whoever decides moves nothing:
the grasps are done by a performer, which follows the plan by itself or leads a person through it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.errors import TactileLabError
from sessions.conductor.estimator import EstimatorService, PlannedGrasp, PoseStep, Reorientation
from sessions.conductor.estimator_client import EstimatorClient
from sessions.motion.bounding_box import BoundingBox
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.safety import InterruptGuard, SafetySupervisor


@dataclass(frozen=True)
class DoGrasp:
    """Do this grasp."""

    plan: GraspPlan


@dataclass(frozen=True)
class UndoGrasp:
    """Take the last grasp back: the estimate is what it was before it, and it is no part of the session."""

    reason: str


@dataclass(frozen=True)
class Wait:
    """Nothing is decided yet: run a cycle and ask again."""


@dataclass(frozen=True)
class Pause:
    """The hand is without demand and the positioner holds for as long as this is the answer."""

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


Decision: TypeAlias = DoGrasp | UndoGrasp | Wait | Pause | End


@dataclass(frozen=True)
class Veto:
    """A captured grasp that does not count."""

    reason: str


class GraspAbandonedError(Exception):
    """Raised by a performer: whoever decides has given up the grasp in hand before it was captured."""


class DecisionMaker(Protocol):
    """Asked before each grasp, told after it. Grasps are numbered from 0."""

    @property
    def centre_m(self) -> Array:
        """Where the middle of the object is thought to be, world x, y."""

    @property
    def suggested(self) -> GraspPlan | None:
        """The grasp that comes next, as far as it is planned."""

    def prepare(self, index: int) -> None:
        """Prepare the decision about grasp ``index``; may take its time while cycles run."""

    def decide(self, index: int) -> Decision:
        """What to do now that grasp ``index`` is next; at once."""

    def on_bounding_box(self, box: BoundingBox) -> None:
        """The object's bounding box was felt."""

    def on_arrival(self, landings_world_m: list[Array]) -> None:
        """The approach has ended; fingertips stood on the object at these places, (3,) each."""

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        """A grasp was measured, where ``plan`` says: how to carry the object now, or why the grasp does not count."""

    def on_carry(self, hand_motion_world: Pose3) -> None:
        """The hand carried the object since the grasp."""

    def on_estimate(self, step: PoseStep) -> None:
        """The estimation has taken the grasp."""

    def on_undo(self) -> None:
        """The last grasp was taken back."""

    def on_failure(self, error: TactileLabError) -> bool:
        """A device failed or a limit was passed, and everything stops: whether the session waits and goes on."""


class Performer(Protocol):
    """Does grasps: the verbs of one, in the order in which they are called. See :class:`GraspCycle`."""

    landings_world_m: list[Array]
    jammed: tuple[str, ...]

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
    """The roles of a session: who supervises, who performs grasps, who decides about them, who estimates.

    Attributes:
        supervisor: looks at every cycle.
        performer: does the grasps.
        decisions: decides about them.
        estimator: where estimation and planner are asked; open while the session runs.
        survey: feels the object's bounding box before the first grasp; asked in between whether to leave the rest out.
            None for a session that begins without.
        guard: hears Ctrl+C while the session runs; whoever waits for a person looks at it.
    """

    supervisor: SafetySupervisor
    performer: Performer
    decisions: DecisionMaker
    estimator: EstimatorClient
    survey: Callable[[Callable[[], bool]], BoundingBox] | None = None
    guard: InterruptGuard = field(default_factory=InterruptGuard)


class AutonomousDecisions:
    """The planner decides, and every grasp counts.

    Attributes:
        estimator: where the planner is asked.
    """

    def __init__(self, estimator: EstimatorClient) -> None:
        self.estimator = estimator
        self._planned: PlannedGrasp | None = None
        self._centre_m: Array | None = None
        """As the planner said it; None when it has heard something since."""

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
        return Wait() if self._planned is None else DoGrasp(self._planned.plan)

    def on_bounding_box(self, box: BoundingBox) -> None:
        self._centre_m = None
        self.estimator.ask(EstimatorService.on_bounding_box, box)

    def on_arrival(self, landings_world_m: list[Array]) -> None:
        self.estimator.ask(EstimatorService.on_landings, landings_world_m)

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        self._centre_m = None
        return self.estimator.ask(EstimatorService.on_grasp, grasp, plan)

    def on_carry(self, hand_motion_world: Pose3) -> None:
        self._centre_m = None
        self.estimator.ask(EstimatorService.on_carry, hand_motion_world)

    def on_estimate(self, step: PoseStep) -> None:
        self._centre_m = None

    def on_undo(self) -> None:
        self._centre_m = None

    def on_failure(self, error: TactileLabError) -> bool:
        return False
