"""The estimator service: tactile SLAM, and the planner that uses its estimate.

Nothing here touches a device. The session asks it one question after the other (see
:mod:`sessions.conductor.estimator_client`), so that it can run in the session's process or in a separate one, with
equal answers.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar
from sessions.conductor.estimator import Estimate, PlannedGrasp, Reorientation
from sessions.motion.bounding_box import BoundingBox
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.surface_message import surface_message
from tactile_lab.autonomy.unknown_part import describe_unknown
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.slam.tactile_slam import TactileSlam


class SlamService:
    """The estimation and the planner of one session: an :class:`~sessions.conductor.estimator.EstimatorService`.

    Args:
        slam: unused.
        planner: uses that estimation.
    """

    def __init__(self, slam: TactileSlam, planner: Planner) -> None:
        self.slam, self.planner = slam, planner
        self._memory = SlamMemory(slam)
        self._estimates: list[Estimate] = []

    # --- what comes next ---------------------------------------------------------------------------------------

    def plan(self, index: int) -> PlannedGrasp:
        """As :meth:`Planner.plan`."""
        return PlannedGrasp(self.planner.plan(index), self.planner.choice)

    def replan(self, index: int) -> PlannedGrasp:
        """As :meth:`Planner.replan`."""
        return PlannedGrasp(self.planner.replan(index), self.planner.choice)

    def centre_m(self) -> Array:
        """As :attr:`Planner.centre_m`."""
        return self.planner.centre_m

    def known_shape(self) -> KnownShape | None:
        """As :meth:`Planner.known_shape`."""
        return self.planner.known_shape()

    def describe_unknown(self) -> str:
        """See :meth:`sessions.conductor.estimator.Estimator.describe_unknown`."""
        world_T_object = self.slam.world_T_object
        return describe_unknown(self.known_shape(), None if world_T_object is None else planar(world_T_object))

    # --- what has happened -------------------------------------------------------------------------------------

    def on_bounding_box(self, box: BoundingBox) -> None:
        """As :meth:`Planner.on_bounding_box`."""
        self.planner.on_bounding_box(box)

    def on_landings(self, points_world_m: list[Array]) -> None:
        """As :meth:`Planner.on_landings`."""
        self.planner.on_landings(points_world_m)

    def on_grasp(self, grasp: Grasp, plan: GraspPlan) -> Reorientation:
        """As :meth:`Planner.on_grasp`."""
        return self.planner.on_grasp(grasp, plan)

    def on_carry(self, hand_motion_world: Pose3) -> None:
        """As :meth:`Planner.on_carry`."""
        self.planner.on_carry(hand_motion_world)

    def estimate(self, grasp: Grasp, known: int) -> tuple[Estimate, ...]:
        """See :meth:`sessions.conductor.estimator.Estimator.estimate`; the planner is notified too."""
        self._memory.remember()
        step = self.slam.add_grasp(grasp)
        self.planner.on_estimate(step.index, step.verdict != "untracked")
        shape = self.planner.known_shape()
        step = replace(step, world_T_object=self.slam.world_T_object)
        self._estimates.append(Estimate(step, surface_message(shape), None if shape is None else shape.explored))
        return tuple(self._estimates[known:])

    def undo(self, hand_motion_world: Pose3) -> None:
        """See :meth:`sessions.conductor.estimator.Estimator.undo`."""
        self._memory.undo()
        self._estimates.pop()
        self.planner.on_undo(hand_motion_world)

    def state(self) -> dict[str, Any]:
        """The complete state of the estimation, including its random numbers."""
        return dict(vars(self.slam))


class SlamMemory:
    """States of an estimation, one for each grasp it was given through :meth:`remember`.

    A state includes the random numbers: after :meth:`undo` the estimation continues exactly as if the grasp had never
    been added.

    Args:
        slam: the estimation; its states are restored into this object.
    """

    def __init__(self, slam: TactileSlam) -> None:
        self._slam = slam
        self._states: list[dict[str, Any]] = []

    def remember(self) -> None:
        """Store the present state; call this before every step."""
        self._states.append(copy.deepcopy(vars(self._slam)))

    def undo(self) -> None:
        """Restore the state before the last step."""
        state = self._states.pop()
        vars(self._slam).clear()
        vars(self._slam).update(state)
