"""Judging a session of the hand that explores: what counts as explored, and what its decisions promised.

A session ends when the object is explored by both definitions, or with its budget. In the plane they are A and B of
:mod:`tactile_lab.experiments.explored`, on the outline at the height of the fingertips. In space the surface counts
without the underside, which nothing can touch: A, 90 % of it lies within 5 mm of the estimated surface; B, a contact
lies within 12 mm besides (half the distance of neighbouring fingertips).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from gtsam import Pose3
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sessions.decisions import Decision, End, Veto
from sessions.grasp_cycle import GraspPlan
from sessions.planner import Reorientation
from sessions.policy_choice import Choice
from sessions.policy_decisions import PolicyDecisions
from sessions.thinking import Thinking
from tactile_lab.errors import ShapeError
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.shape import compare_contour, compare_mesh, horizontal_outline
from tactile_lab.experiments.explored import GOAL, ExploredMap
from tactile_lab.experiments.explored_objects import moved_alike
from tactile_lab.geometry.contacts import Array, Grasp
from tactile_lab.geometry.poses import transform_points
from tactile_lab.shape.sampling import sample_polygon
from tactile_lab.shape.surface import extract_mesh
from tactile_lab.slam import TactileSlam
from tactile_lab.slam_result import SlamResult

_WITHIN_m = 0.005
_CONTACT_m = 0.012
_UNDERSIDE = -0.9
_SAMPLES = 2000
_DENSE_SAMPLES = 20_000
_MESH_GRID_m = 0.005


class Judge:
    """Judges a session while it runs; nothing of it reaches the session but that it may end.

    Args:
        mesh: the true surface, in the frame whose poses are told.
        slam: the estimation.
        dimension: 2 or 3.
    """

    def __init__(self, mesh: trimesh.Trimesh, slam: TactileSlam, dimension: int) -> None:
        self._mesh, self._slam, self._dimension = mesh, slam, dimension
        self._true_points_m = reachable_points(mesh, dimension)
        self.truth: list[Pose3] = []
        """True pose of the object at each grasp."""
        self.grasps: list[Grasp] = []
        self.choices: dict[int, Choice] = {}
        self.shares: list[tuple[float, float]] = []
        """Of the surface explored after each grasp, by A and by B."""
        self.minutes: list[float] = []
        """Simulated time at which each grasp was done."""
        self.actions = 0
        """Approaches so far: every grasp is one, done or given up, and a tap on the top before it another."""
        self._actions_at: list[int] = []

    @property
    def is_explored(self) -> bool:
        """By both definitions in the plane, by A in space: contacts everywhere would take fifty grasps there."""
        asked = (0, 1) if self._dimension == 2 else (0,)
        return all(self._first(which) is not None for which in asked)

    def keep(self, choice: Choice) -> None:
        """Take note of a decision."""
        self.choices[choice.number - 1] = choice

    def look(self, minutes: float) -> None:
        """See what is explored after a grasp that was done at this time."""
        self.minutes.append(minutes)
        self._actions_at.append(self.actions)
        self.shares.append(self._explored())

    def _explored(self) -> tuple[float, float]:
        surface = self._slam.surface
        points = self._in_map_frame()
        if surface is None or points is None:
            return 0.0, 0.0
        if self._dimension == 2:
            known = ExploredMap.of(surface.contacts_m, surface.normals)
            return float(known.explored("A5", points).mean()), float(known.explored("B", points).mean())
        near = surface_within(self._slam, points, _WITHIN_m)
        touched = cKDTree(surface.contacts_m).query(points)[0] < _CONTACT_m
        return float(near.mean()), float((near & touched).mean())

    def _in_map_frame(self) -> Array | None:
        """The true points laid over the estimate by the best fit of all contacts; None before there are enough."""
        placed = zip(self.grasps, self._slam.trajectory, self.truth, strict=False)
        parts = [(_seen(grasp, pose), _seen(grasp, true)) for grasp, pose, true in placed if pose and grasp.contacts]
        if sum(len(part[0]) for part in parts) < 3:
            return None
        estimated, true_m = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        return laid_over(self._true_points_m, true_m, estimated)

    def _first(self, which: int) -> int | None:
        """Number of the grasp, from 0, that reached the goal by one of the definitions; None if none did."""
        return next((number for number, share in enumerate(self.shares) if share[which] >= GOAL), None)

    def figures(self, result: SlamResult) -> dict[str, Any]:
        """The figures of a session that has ended."""
        points = [grasp.points_world_m for grasp in self.grasps]
        poses, count = result.world_T_object, min(len(result.world_T_object), len(self.truth))
        return {
            **self._reached("A", 0),
            **self._reached("B", 1),
            "share_A": self.shares[-1][0] if self.shares else 0.0,
            "share_B": self.shares[-1][1] if self.shares else 0.0,
            "contacts": sum(map(len, points)),
            "registration_mm": registration_rms_mm(points[:count], poses[:count], self.truth[:count], self._dimension),
            "hausdorff_mm": self._hausdorff_mm(result),
            "promises": self._kept_promises(),
        }

    def _reached(self, definition: str, which: int) -> dict[str, float | None]:
        """Actions and simulated minutes until the goal by a definition; None where it was not reached."""
        number = self._first(which)
        actions, minutes = (None, None) if number is None else (self._actions_at[number], self.minutes[number])
        return {f"actions_{definition}": actions, f"minutes_{definition}": minutes}

    def status(self, ending: str) -> str:
        """How a session that ended so counts: "ok" where all was explored."""
        if ending != "complete":
            return ending
        return "ok" if self.is_explored else "not explored"

    def _hausdorff_mm(self, result: SlamResult) -> float | None:
        """At the best rigid fit; None where there is no shape."""
        if result.contour is not None:
            outline = horizontal_outline(self._mesh, _middle_m(self._mesh))
            return 1e3 * compare_contour(result.contour.points_m[:-1], outline, None).best_fit.hausdorff_m
        if result.mesh is not None:
            mesh = trimesh.Trimesh(result.mesh.vertices, result.mesh.faces, process=False)
            return 1e3 * compare_mesh(mesh, self._mesh, None).best_fit.hausdorff_m
        return None

    def _kept_promises(self) -> list[list[float]]:
        """What each decision promised, and what came of it by definition B."""
        before = [0.0, *(share[1] for share in self.shares)]
        return [
            [choice.decision.promised_gain, before[index + 1] - before[index]]
            for index, choice in sorted(self.choices.items())
            if choice.decision.promised_gain is not None and index < len(self.shares)
        ]


class UntilExplored(PolicyDecisions):
    """Follows the policy until the judge says that all is explored.

    Args:
        thinking: where the planner with the policy is asked.
        judge: says so.
    """

    def __init__(self, thinking: Thinking, judge: Judge) -> None:
        super().__init__(thinking, judge.keep)
        self._judge = judge

    def arrived(self, landings_world_m: list[Array]) -> None:
        assert self.suggested is not None
        self._judge.actions += 2 if self.suggested.tap else 1
        super().arrived(landings_world_m)

    def captured(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        self._judge.grasps.append(grasp)
        return super().captured(grasp, plan)

    def decide(self, index: int) -> Decision:
        decision = super().decide(index)
        return End("explored") if self._judge.is_explored else decision


def reachable_points(mesh: trimesh.Trimesh, dimension: int) -> Array:
    """Points of the true surface that fingers can touch: the outline half-way up, or all but the underside.

    Returns:
        Shape (n, dimension), object frame.
    """
    if dimension == 2:
        return sample_polygon(horizontal_outline(mesh, _middle_m(mesh)), 0.001)
    points, faces = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=0)
    return np.asarray(points[mesh.face_normals[faces][:, 2] > _UNDERSIDE])


def _middle_m(mesh: trimesh.Trimesh) -> float:
    return float(mesh.bounds[:, 2].mean())


def _seen(grasp: Grasp, pose: Pose3) -> Array:
    """A grasp's contacts in the frame of an object at ``pose``, shape (n, 3)."""
    return transform_points(pose.inverse(), grasp.points_world_m)


def laid_over(points_m: Array, source_m: Array, target_m: Array) -> Array:
    """Points moved as ``source_m`` is moved best onto ``target_m``, both (n, 3): in the plane, and along z."""
    flat = moved_alike(points_m[:, :2], source_m[:, :2], target_m[:, :2])
    if points_m.shape[1] == 2:
        return flat
    return np.column_stack([flat, points_m[:, 2] + float(np.mean(target_m[:, 2] - source_m[:, 2]))])


def surface_within(slam: TactileSlam, points_m: Array, reach_m: float) -> NDArray[np.bool_]:
    """Which points, shape (n, 3), lie within reach of the surface as estimated now; none where there is none."""
    surface = slam.surface
    try:
        mesh = None if surface is None else extract_mesh(surface, resolution_m=_MESH_GRID_m)
    except ShapeError:
        mesh = None
    if mesh is None:
        return np.zeros(len(points_m), dtype=bool)
    dense = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    samples, _ = trimesh.sample.sample_surface(dense, _DENSE_SAMPLES, seed=0)
    return np.asarray(cKDTree(samples).query(points_m)[0] < reach_m)
