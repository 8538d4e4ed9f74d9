"""All of a session that takes its time: the estimation, and the planner that chooses grasps by it.

Nothing here touches a device. The session asks it one question after the other (see :mod:`sessions.thinking`), so that
it can live in the session's process or in one of its own, and answers alike in both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from gtsam import Pose3

from sessions.bounding_box import BoundingBox
from sessions.explorer import KnownShape
from sessions.grasp_plan import GraspPlan
from sessions.planner import Planner, Reorientation
from sessions.policy_choice import Choice
from sessions.slam_memory import SlamMemory
from sessions.view_messages import surface_message
from tactile_lab.geometry.contacts import Array, Grasp
from tactile_lab.slam import TactileSlam
from tactile_lab.slam_result import SlamStep


@dataclass(frozen=True)
class Thought:
    """The grasp that comes next.

    Attributes:
        plan: it.
        choice: the policy's decision about it; None where the policy was not asked.
    """

    plan: GraspPlan
    choice: Choice | None


@dataclass(frozen=True)
class Estimate:
    """What has come of one grasp.

    Attributes:
        step: of the estimation, with the object where the surface is told to be.
        surface: the shape as plain data, see :func:`sessions.view_messages.surface_message`.
        explored: share of the surface that is known, 0..1; None before there is one.
    """

    step: SlamStep
    surface: dict[str, Any]
    explored: float | None


class Thinker:
    """The estimation and the planner of one session.

    Args:
        slam: fresh.
        planner: over that estimation.
    """

    def __init__(self, slam: TactileSlam, planner: Planner) -> None:
        self.slam, self.planner = slam, planner
        self._memory = SlamMemory(slam)
        self._estimates: list[Estimate] = []

    # --- what comes next ---------------------------------------------------------------------------------------

    def plan(self, index: int) -> Thought:
        """As :meth:`Planner.plan`."""
        return Thought(self.planner.plan(index), self.planner.choice)

    def vetoed(self, index: int) -> Thought:
        """As :meth:`Planner.vetoed`."""
        return Thought(self.planner.vetoed(index), self.planner.choice)

    def centre_m(self) -> Array:
        """As :attr:`Planner.centre_m`."""
        return self.planner.centre_m

    def known_shape(self) -> KnownShape | None:
        """As :meth:`Planner.known_shape`."""
        return self.planner.known_shape()

    # --- what has happened -------------------------------------------------------------------------------------

    def boxed(self, box: BoundingBox) -> None:
        """As :meth:`Planner.boxed`."""
        self.planner.boxed(box)

    def landed(self, points_world_m: list[Array]) -> None:
        """As :meth:`Planner.landed`."""
        self.planner.landed(points_world_m)

    def grasped(self, grasp: Grasp, plan: GraspPlan) -> Reorientation:
        """As :meth:`Planner.grasped`."""
        return self.planner.grasped(grasp, plan)

    def carried(self, hand_motion_world: Pose3) -> None:
        """As :meth:`Planner.carried`."""
        self.planner.carried(hand_motion_world)

    def estimate(self, grasp: Grasp, known: int) -> tuple[Estimate, ...]:
        """One step of the estimation, of which the planner takes note.

        Args:
            grasp: the next one.
            known: so many estimates have reached the session.

        Returns:
            the estimates that have not reached it, the newest last: more than one where an earlier question was
            interrupted by a failing device.
        """
        self._memory.remember()
        step = self.slam.take(grasp)
        self.planner.estimated(step.index, step.verdict != "untracked")
        shape = self.planner.known_shape()
        step = replace(step, world_T_object=self.slam.world_T_object)
        self._estimates.append(Estimate(step, surface_message(shape), None if shape is None else shape.explored))
        return tuple(self._estimates[known:])

    def undo(self, hand_motion_world: Pose3) -> None:
        """Back to before the last step; the hand carried the object so far since the grasp before it."""
        self._memory.undo()
        self._estimates.pop()
        self.planner.undone(hand_motion_world)

    def state(self) -> dict[str, Any]:
        """Everything that the estimation knows, the source of chance too."""
        return dict(vars(self.slam))
