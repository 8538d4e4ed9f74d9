"""What a session asks of an estimator and of whoever plans grasps: protocols, and the values that pass between.

A session records, replays and conducts whichever estimator and planner it is given; :mod:`tactile_lab.autonomy` has the
program's own. Nothing behind these protocols touches a device: the session asks one question after the other (see
:mod:`sessions.conductor.estimator_client`), so that the answers may come from its own process or from another one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from sessions.motion.bounding_box import BoundingBox
from sessions.motion.grasp_plan import GraspPlan


@dataclass(frozen=True)
class Reorientation:
    """How to carry the object: turn about the grasp's vertical axis, and shift (2,) along the world's axes."""

    turn_rad: float
    shift_world_m: Array

    @property
    def moves(self) -> bool:
        """Whether it is carried at all; else the hand opens and leaves it where it is."""
        return bool(self.turn_rad != 0.0 or np.any(self.shift_world_m != 0.0))


class PoseStep(Protocol):
    """What one grasp told about the object's pose."""

    @property
    def index(self) -> int:
        """Of the grasp, from 0."""

    @property
    def world_T_object(self) -> Pose3 | None:
        """The pose after this grasp; None before the object frame is born."""

    @property
    def covariance(self) -> Array | None:
        """Of (x m, y m, yaw rad) in the world, shape (3, 3); None as the pose."""

    @property
    def verdict(self) -> str:
        """One word: whether the grasp could be placed on the object."""

    @property
    def reason(self) -> str:
        """The verdict in words."""

    @property
    def seconds(self) -> float:
        """Computing time."""


@dataclass(frozen=True)
class Estimate:
    """What has come of one grasp.

    Attributes:
        step: the pose, with the object where the surface is told to be.
        surface: the shape as plain data, as it is recorded and shown (topic ``/slam/surface``).
        explored: share of the surface that is known, 0..1; None before there is one.
    """

    step: PoseStep
    surface: dict[str, Any]
    explored: float | None


class Estimator(Protocol):
    """A grasp in, an estimate out; the last grasp can be taken back."""

    def estimate(self, grasp: Grasp, known: int) -> tuple[Estimate, ...]:
        """Take the next grasp.

        Args:
            grasp: the next one.
            known: so many estimates have reached the session.

        Returns:
            the estimates that have not reached it, the newest last: more than one where an earlier question was
            interrupted by a failing device.
        """

    def undo(self, hand_motion_world: Pose3) -> None:
        """Forget the last grasp; the hand carried the object so far since the grasp before it."""

    def describe_unknown(self) -> str:
        """Which part of the object is still unknown, in words for a person at the table."""


class PolicyChoice(Protocol):
    """A policy's decision about the next grasp, as far as a session records and tells it."""

    @property
    def is_over(self) -> bool:
        """Whether the policy has nothing more to gain: the session ends."""

    @property
    def reason(self) -> str:
        """Why it decided so."""

    @property
    def failure(self) -> str:
        """What is wrong with the policy itself, in words; empty while its answers can be followed."""

    def as_plain(self) -> dict[str, Any]:
        """The whole decision as plain data, for the recording (topic ``/policy/decision``)."""

    def sentence(self) -> str:
        """The decision in one line, for people."""


@dataclass(frozen=True)
class PlannedGrasp:
    """The grasp that comes next.

    Attributes:
        plan: it.
        choice: the policy's decision about it; None where no policy was asked.
        exhausted: why nothing is left to do, in words: the plan is none then. Empty while there is something.
    """

    plan: GraspPlan
    choice: PolicyChoice | None
    exhausted: str = ""


class GraspPlanner(Protocol):
    """Chooses every grasp of a session, and hears what came of it. Grasps are numbered from 0."""

    def plan(self, index: int) -> PlannedGrasp:
        """The grasp number ``index``."""

    def replan(self, index: int) -> PlannedGrasp:
        """Another plan for the same grasp, after a person has refused the last one."""

    def centre_m(self) -> Array:
        """Where the middle of the object is thought to be, world x, y, shape (2,)."""

    def on_bounding_box(self, box: BoundingBox) -> None:
        """The object's bounding box was felt."""

    def on_landings(self, points_world_m: list[Array]) -> None:
        """Fingertips came down on the object at these places, (3,) each."""

    def on_grasp(self, grasp: Grasp, plan: GraspPlan) -> Reorientation:
        """A grasp was measured where ``plan`` says; how to carry the object from there."""

    def on_carry(self, hand_motion_world: Pose3) -> None:
        """The hand carried the object since the last grasp."""


class EstimatorService(Estimator, GraspPlanner, Protocol):
    """All of a session that takes its time: the estimation, and the planner that chooses grasps by it."""
