"""Protocols of the estimator and the grasp planner of a session, and the values they exchange.

A session works with any estimator and planner; :mod:`tactile_lab.autonomy` has the program's own. Implementations touch
no device: the session asks one question after the other (see :mod:`sessions.conductor.estimator_client`), so that the
answers may come from its own process or from another one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.perception.hand_odometry import HandMotion


@dataclass(frozen=True)
class Reorientation:
    """How to carry the object: turn about the grasp's vertical axis, and shift (2,) along the world's axes."""

    turn_rad: float
    shift_world_m: Array

    @property
    def moves(self) -> bool:
        """Whether it is carried at all; otherwise the hand opens and leaves it in place."""
        return bool(self.turn_rad != 0.0 or np.any(self.shift_world_m != 0.0))


class PoseStep(Protocol):
    """The object's pose as estimated from one grasp."""

    @property
    def index(self) -> int:
        """Of the grasp, from 0."""

    @property
    def world_T_object(self) -> Pose3 | None:
        """The pose after this grasp; None before the object frame is defined."""

    @property
    def covariance(self) -> Array | None:
        """Of (x m, y m, yaw rad) in the world, shape (3, 3); None if there is no pose."""

    @property
    def verdict(self) -> str:
        """One word: whether the grasp could be registered to the object."""

    @property
    def reason(self) -> str:
        """The verdict as a sentence."""

    @property
    def seconds(self) -> float:
        """Computing time."""


@dataclass(frozen=True)
class Estimate:
    """The estimate after one grasp.

    Attributes:
        step: the pose, consistent with the surface.
        surface: the shape as plain data for recording and display (topic ``/slam/surface``).
        explored: share of the surface that is known, 0..1; None before there is one.
        trust: how far to trust it, as plain data for recording and display: ``status``, and ``doubts`` and
            ``alternatives`` as sentences; empty where the estimator does not say.
    """

    step: PoseStep
    surface: dict[str, Any]
    explored: float | None
    trust: dict[str, Any] = field(default_factory=dict)


class Estimator(Protocol):
    """Takes grasps, returns estimates, and can undo the last grasp."""

    def estimate(self, grasp: Grasp, known: int) -> tuple[Estimate, ...]:
        """Take the next grasp.

        Args:
            grasp: the next one.
            known: number of estimates that have reached the session.

        Returns:
            the estimates that have not reached it, the newest last: more than one if an earlier question was
            interrupted by a failing device.
        """

    def undo(self, hand_motion_world: Pose3) -> None:
        """Undo the last grasp. ``hand_motion_world`` is how the hand carried the object since the grasp before it."""

    def describe_unknown(self) -> str:
        """Which part of the object is still unknown, as a sentence for the operator."""


class PolicyChoice(Protocol):
    """A policy's decision about the next grasp, as a session records and shows it."""

    @property
    def is_over(self) -> bool:
        """Whether the policy has nothing more to gain: the session ends."""

    @property
    def reason(self) -> str:
        """The reason for the decision."""

    @property
    def failure(self) -> str:
        """What is wrong with the policy itself; empty while its answers are valid."""

    def as_plain(self) -> dict[str, Any]:
        """The whole decision as plain data, for the recording (topic ``/decision``)."""

    def sentence(self) -> str:
        """The decision in one line, for people."""


@dataclass(frozen=True)
class Search:
    """The object may not be where it was: it has to be looked for.

    Attributes:
        reason: why, in words.
        places_m: where it is tapped on, in this order, until something is met; world x, y, shape (n, 2).
        top_m: height of its top before; if it is met so high at the first place it stands as it stood. None: its sides
            are felt in any case.
    """

    reason: str
    places_m: Array
    top_m: float | None = None


class Change(StrEnum):
    """What has become of an object that was looked for."""

    STANDS = "stands where it stood"
    MOVED = "was pushed aside"
    FELL = "fell over"


@dataclass(frozen=True)
class PlannedGrasp:
    """The next grasp.

    Attributes:
        plan: the grasp.
        choice: the policy's decision about it; None if no policy was asked.
        exhausted: why nothing is left to do, in words: the plan is none then. Empty while there is something.
        search: how to look for the object first: the plan is none then. None where it is believed where it was.
    """

    plan: GraspPlan
    choice: PolicyChoice | None
    exhausted: str = ""
    search: Search | None = None


class GraspPlanner(Protocol):
    """Chooses every grasp of a session, and receives its outcome. Grasps are numbered from 0."""

    def plan(self, index: int) -> PlannedGrasp:
        """Plan grasp number ``index``."""

    def replan(self, index: int) -> PlannedGrasp:
        """Another plan for the same grasp, after a person has vetoed the last one."""

    def centre_m(self) -> Array:
        """Estimated centre of the object, world x, y, shape (2,)."""

    def on_bounding_box(self, box: BoundingBox) -> None:
        """The object's bounding box was measured."""

    def on_found_again(self, box: BoundingBox) -> tuple[Change, str]:
        """The object was looked for, and met. Returns what has become of it, also in words."""

    def on_landings(self, points_world_m: list[Array]) -> None:
        """Fingertips landed on the object at these points, (3,) each."""

    def on_grasp(self, grasp: Grasp, plan: GraspPlan) -> Reorientation:
        """A grasp was measured at ``plan``. Returns how to carry the object now."""

    def on_carry(self, motion: HandMotion) -> None:
        """The hand carried the object since the last grasp, or left it where it is."""


class EstimatorService(Estimator, GraspPlanner, Protocol):
    """The expensive parts of a session: the estimator, and the planner that uses its estimate."""
