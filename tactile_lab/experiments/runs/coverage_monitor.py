"""Coverage of an exploring session after every action, and the expected and actual gain of its decisions.

A session ends when the object is explored, when its budget of actions is spent, or when the object is lost. In the
plane the object is explored when the outline at the height of the fingertips is, by definitions A and B of
:mod:`tactile_lab.experiments.coverage_criteria`. In space the underside, which nothing can touch, is ignored, and
definition A ends the session: 90 % of the surface lies within 5 mm of the estimated one, and 90 % of that within 5 mm
of the true one. Definition B also asks for a contact within 12 mm (half the distance of neighbouring fingertips) of 90
% of the surface. The estimated surface is that of the most probable model, which the planner uses and with which a
session would end. It may fit by chance, and no longer fit after the next grasp. So in space a goal counts as reached at
the first of two successive checks that both find it reached, or at the last check that the budget allows. The surface
near true contact positions counts as *touched* (4.5 mm in the plane, 12 mm in space), independent of the estimate; this
is the gain that a decision predicts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from gtsam import Pose3

from drivers.core.contacts import Array, Grasp
from drivers.core.poses import transform_points
from sessions.conductor.decisions import Decision, End, Veto
from sessions.conductor.estimator import PolicyChoice, Reorientation
from sessions.conductor.estimator_client import EstimatorClient
from sessions.conductor.policy_decisions import PolicyDecisions
from sessions.motion.grasp_plan import GraspPlan
from sessions.perception.hand_odometry import HandMotion
from tactile_lab.autonomy.policy_choice import Choice
from tactile_lab.autonomy.variance_planner import KnownShape
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.shape import compare_contour, compare_mesh
from tactile_lab.experiments.coverage_criteria import GOAL, CONTACT_m, ExploredMap
from tactile_lab.experiments.data.true_surface import (
    lay_over,
    reachable_points,
    surface_within,
    true_outline,
    true_share,
    within,
)
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.tactile_slam import TactileSlam

MEASURES = ("A", "B", "touched")
"""The quantities recorded after each action."""

_WITHIN_m = 0.005
_CONTACT_IN_SPACE_m = 0.012


@dataclass(frozen=True)
class Look:
    """Coverage after a grasp.

    Attributes:
        actions: number of actions so far.
        minutes: simulated time.
        shares: of the surface, by each of the measures.
    """

    actions: int
    minutes: float
    shares: dict[str, float]


class CoverageMonitor:
    """Monitors the coverage of a running session; it only decides when the session ends.

    Args:
        mesh: the true surface, in the frame of the true poses.
        slam: the estimation.
        shape: returns the present shape of the session's planner.
        dimension: 2 or 3.
        budget: largest number of actions.
    """

    def __init__(
        self,
        mesh: trimesh.Trimesh,
        slam: TactileSlam,
        shape: Callable[[], KnownShape | None],
        dimension: int,
        budget: int,
    ) -> None:
        self._mesh, self._slam, self._shape, self._dimension, self._budget = mesh, slam, shape, dimension, budget
        self._true_points_m = reachable_points(mesh, dimension)
        self.truth: list[Pose3] = []
        """True pose of the object at each grasp."""
        self.grasps: list[Grasp] = []
        self.choices: dict[int, Choice] = {}
        self.looks: list[Look] = []
        """One for each grasp."""
        self.actions = 0
        """Number of approaches: each grasp, finished or given up, is one, and a tap on the top before it is another."""
        self.carried = 0
        """How often the object was carried."""

    @property
    def is_explored(self) -> bool:
        """By both definitions in the plane; by A in space, where contacts everywhere would take fifty grasps."""
        asked = ("A", "B") if self._dimension == 2 else ("A",)
        return all(self._first(measure) is not None for measure in asked)

    @property
    def is_over(self) -> bool:
        """Whether the object is explored, or the budget is spent."""
        return self.is_explored or self.actions >= self._budget

    def keep(self, choice: PolicyChoice) -> None:
        """Take note of a decision."""
        assert isinstance(choice, Choice)
        self.choices[choice.number - 1] = choice

    def look(self, minutes: float) -> None:
        """Update the coverage after a grasp that ended at this time."""
        self.looks.append(Look(self.actions, minutes, self._coverage()))

    def _coverage(self) -> dict[str, float]:
        near, touched = self._near_and_touched()
        return {"A": near[0], "B": near[1], "touched": touched}

    def _near_and_touched(self) -> tuple[tuple[float, float], float]:
        """Shares by A and B, and the share that was truly touched."""
        true_contacts_m = np.concatenate([_see(g, t) for g, t in zip(self.grasps, self.truth, strict=False)])
        touched = within(self._true_points_m, true_contacts_m[:, : self._dimension], self._reach_m)
        known, points = self._shape(), self._in_map_frame(self._true_points_m)
        if known is None or points is None:
            return (0.0, 0.0), float(touched.mean())
        contacts_m = known.field.contacts_m
        if self._dimension == 2:
            outline = ExploredMap.of(contacts_m, known.field.normals)
            shares = (
                float(outline.explored_points("A5", points).mean()),
                float(outline.explored_points("B", points).mean()),
            )
        else:
            near = surface_within(known.surface, points, _WITHIN_m)
            shares = (
                min(float(near.mean()), self._true_share(known)),
                float((near & within(points, contacts_m, self._reach_m)).mean()),
            )
        return shares, float(touched.mean())

    def _true_share(self, known: KnownShape) -> float:
        """Share of the estimated surface that lies near the true one."""
        vertices = self._in_map_frame(np.asarray(self._mesh.vertices))
        if known.surface is None or vertices is None:
            return 0.0
        true_mesh = trimesh.Trimesh(vertices, self._mesh.faces, process=False)
        return true_share(known.surface, known.origin_height_m, true_mesh, _WITHIN_m)

    @property
    def _reach_m(self) -> float:
        """Distance from a contact within which the surface counts as touched."""
        return CONTACT_m if self._dimension == 2 else _CONTACT_IN_SPACE_m

    def _in_map_frame(self, points_m: Array) -> Array | None:
        """True points aligned to the estimate by the best fit of all contacts; None before there are enough."""
        placed = zip(self.grasps, self._slam.trajectory, self.truth, strict=False)
        parts = [(_see(grasp, pose), _see(grasp, true)) for grasp, pose, true in placed if pose and grasp.contacts]
        if sum(len(part[0]) for part in parts) < 3:
            return None
        estimated, true_m = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        return lay_over(points_m, true_m, estimated)

    def _first(self, measure: str) -> Look | None:
        """When the goal was reached by one of the measures, within the budget; None if it never was."""
        numbers = (number for number, look in enumerate(self.looks) if look.actions <= self._budget)
        return next((self.looks[number] for number in numbers if self._is_reached(measure, number)), None)

    def _is_reached(self, measure: str, number: int) -> bool:
        """In space only if the next check confirms it, or the budget allows none; see the module's text."""
        shares = [look.shares[measure] for look in self.looks[number:]]
        if shares[0] < GOAL or self._dimension == 2:
            return shares[0] >= GOAL
        return shares[1] >= GOAL if len(shares) > 1 else self.actions >= self._budget

    # --- figures -----------------------------------------------------------------------------------------------

    def figures(self, result: SlamResult) -> dict[str, Any]:
        """The figures of a session that has ended."""
        points = [grasp.points_world_m for grasp in self.grasps]
        poses, count = result.world_T_object, min(len(result.world_T_object), len(self.truth))
        return {
            **self._effort_to_goal("A"),
            **self._effort_to_goal("B"),
            **self._history(),
            "contacts": sum(map(len, points)),
            "carried": self.carried,
            "registration_mm": registration_rms_mm(points[:count], poses[:count], self.truth[:count], self._dimension),
            "hausdorff_mm": self._hausdorff_mm(result),
            "promises": self._kept_promises(),
        }

    def _effort_to_goal(self, measure: str) -> dict[str, float | None]:
        """Actions and simulated minutes until the goal, None if it was not reached; actions count up to the budget."""
        look = self._first(measure)
        actions, minutes = (None, None) if look is None else (look.actions, look.minutes)
        most = self._budget if actions is None else actions
        return {f"actions_{measure}": actions, f"minutes_{measure}": minutes, f"at_most_{measure}": most}

    def _history(self) -> dict[str, Any]:
        """Each measure after 0, 1, ... actions, its mean, and its final value; it stays constant after the hand
        stops.
        """
        figures: dict[str, Any] = {}
        for measure in MEASURES:
            curve = [self._share_after(actions, measure) for actions in range(self._budget + 1)]
            figures[f"curve_{measure}"] = [round(share, 4) for share in curve]
            figures[f"area_{measure}"] = float(np.mean(curve[1:]))
            figures[f"share_{measure}"] = curve[-1]
        return figures

    def _share_after(self, actions: int, measure: str) -> float:
        done = [look.shares[measure] for look in self.looks if look.actions <= actions]
        return done[-1] if done else 0.0

    def status(self, ending: str) -> str:
        """The status of a session that ended for this reason: "ok" if the object was explored."""
        if ending != "complete":
            return ending
        return "ok" if self.is_explored else "not explored"

    def _hausdorff_mm(self, result: SlamResult) -> float | None:
        """Hausdorff distance at the best rigid fit; None if there is no shape."""
        if result.contour is not None:
            outline = true_outline(self._mesh)
            return 1e3 * compare_contour(result.contour.points_m[:-1], outline, None).best_fit.hausdorff_m
        if result.mesh is not None:
            mesh = trimesh.Trimesh(result.mesh.vertices, result.mesh.faces, process=False)
            return 1e3 * compare_mesh(mesh, self._mesh, None).best_fit.hausdorff_m
        return None

    def _kept_promises(self) -> list[list[float]]:
        """The gain that each decision predicted, and the share of the surface that its grasp touched for the first
        time.
        """
        touched = [0.0, *(look.shares["touched"] for look in self.looks)]
        return [
            [choice.decision.promised_gain, touched[index + 1] - touched[index]]
            for index, choice in sorted(self.choices.items())
            if choice.decision.promised_gain is not None and index < len(self.looks)
        ]


class UntilExplored(PolicyDecisions):
    """Follows the policy until the monitor reports that the object is explored or the budget is spent.

    Args:
        estimator: client of the planner with the policy.
        monitor: decides when to end.
    """

    def __init__(self, estimator: EstimatorClient, monitor: CoverageMonitor) -> None:
        super().__init__(estimator, monitor.keep)
        self._monitor = monitor

    def prepare(self, index: int) -> None:
        if not self._monitor.is_over:
            super().prepare(index)

    def on_arrival(self, landings_world_m: list[Array]) -> None:
        assert self.suggested is not None
        self._monitor.actions += 2 if self.suggested.tap else 1
        super().on_arrival(landings_world_m)

    def on_capture(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        self._monitor.grasps.append(grasp)
        return super().on_capture(grasp, plan)

    def on_carry(self, motion: HandMotion) -> None:
        self._monitor.carried += not motion.is_rest
        super().on_carry(motion)

    def decide(self, index: int) -> Decision:
        return End("explored, or the budget is spent") if self._monitor.is_over else super().decide(index)


def _see(grasp: Grasp, pose: Pose3) -> Array:
    """A grasp's contacts in the frame of an object at ``pose``, shape (n, 3)."""
    return transform_points(pose.inverse(), grasp.points_world_m)
