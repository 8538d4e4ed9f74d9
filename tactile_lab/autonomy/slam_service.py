"""The estimator service: tactile SLAM, and the planner that uses its estimate.

Nothing here touches a device. The session asks it one question after the other (see
:mod:`sessions.conductor.estimator_client`), so that it can run in the session's process or in a separate one, with
equal answers.
"""

from __future__ import annotations

import copy
from collections import deque
from dataclasses import replace
from typing import Any

from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar
from sessions.conductor.estimator import Change, Estimate, PlannedGrasp, Reorientation
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.estimate_messages import surface_message, trust_message
from tactile_lab.autonomy.freed_memory import return_freed_memory
from tactile_lab.autonomy.planner import Planner
from tactile_lab.autonomy.unknown_part import describe_unknown
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.slam.tactile_slam import TactileSlam

KEPT_STATES = 3
"""More grasps than this are seldom taken back one after the other."""


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
        """Those that the session may not have yet: surfaces are large."""
        self._count = 0

    # --- what comes next ---------------------------------------------------------------------------------------

    def plan(self, index: int) -> PlannedGrasp:
        """As :meth:`Planner.plan`."""
        return self._planned(self.planner.plan(index))

    def replan(self, index: int) -> PlannedGrasp:
        """As :meth:`Planner.replan`."""
        return self._planned(self.planner.replan(index))

    def _planned(self, plan: GraspPlan) -> PlannedGrasp:
        return PlannedGrasp(plan, self.planner.choice, self.planner.exhausted, self.planner.search)

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

    def on_found_again(self, box: BoundingBox) -> tuple[Change, str]:
        """As :meth:`Planner.on_found_again`."""
        return self.planner.on_found_again(box)

    def on_landings(self, points_world_m: list[Array]) -> None:
        """As :meth:`Planner.on_landings`."""
        self.planner.on_landings(points_world_m)

    def on_grasp(self, grasp: Grasp, plan: GraspPlan) -> Reorientation:
        """As :meth:`Planner.on_grasp`."""
        return self.planner.on_grasp(grasp, plan)

    def on_carry(self, motion: HandMotion) -> None:
        """As :meth:`Planner.on_carry`."""
        self.planner.on_carry(motion)

    def estimate(self, grasp: Grasp, known: int) -> tuple[Estimate, ...]:
        """See :meth:`sessions.conductor.estimator.Estimator.estimate`; the planner is notified too."""
        self._memory.remember(grasp)
        step = self.slam.add_grasp(grasp)
        self.planner.on_estimate(step.index, step.verdict != "untracked")
        shape = self.planner.known_shape()
        step = replace(step, world_T_object=self.slam.world_T_object)
        explored, trust = None if shape is None else shape.explored, trust_message(self.planner.assessment())
        self._estimates.append(Estimate(step, surface_message(shape), explored, trust))
        self._count += 1
        self._estimates = self._estimates[known - self._count :]
        return_freed_memory()
        return tuple(self._estimates)

    def undo(self, hand_motion_world: Pose3) -> None:
        """See :meth:`sessions.conductor.estimator.Estimator.undo`."""
        self._memory.undo()
        self._count -= 1
        self._estimates = self._estimates[:-1]
        self.planner.on_undo(hand_motion_world)

    def state(self) -> dict[str, Any]:
        """The complete state of the estimation, including its random numbers."""
        return dict(vars(self.slam))


class SlamMemory:
    """What an estimation knew before each of its last grasps, so that they can be taken back.

    A state includes the random numbers: after :meth:`undo` the estimation continues exactly as if the grasp had never
    been added. States grow with the session, so that only the last few are kept; to go back farther the grasps are
    estimated again from the beginning, with the same result.

    Args:
        slam: the estimation, unused; its states are restored into this object.
    """

    def __init__(self, slam: TactileSlam) -> None:
        self._slam = slam
        self._fresh = self._state()
        self._grasps: list[Grasp] = []
        self._states: deque[dict[str, Any]] = deque(maxlen=KEPT_STATES)

    def remember(self, grasp: Grasp) -> None:
        """Store the present state; call this before every step, with its grasp."""
        self._grasps.append(grasp)
        self._states.append(self._state())

    def undo(self) -> None:
        """Go back to before the last step."""
        grasps, self._grasps = self._grasps[:-1], self._grasps[:-1]
        if self._states:
            self._put_back(self._states.pop())
            return
        self._put_back(copy.deepcopy(self._fresh))
        self._grasps = []
        for grasp in grasps:
            self.remember(grasp)
            self._slam.add_grasp(grasp)

    def _state(self) -> dict[str, Any]:
        return copy.deepcopy(vars(self._slam))

    def _put_back(self, state: dict[str, Any]) -> None:
        vars(self._slam).clear()
        vars(self._slam).update(state)
