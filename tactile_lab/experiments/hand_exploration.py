"""Exploration by the simulated hand: policies over the hand's own candidates, whole sessions, truth for judging only.

A session ends when the object is explored by both definitions, or with its budget. In the plane they are A and B of
:mod:`tactile_lab.experiments.explored`, on the outline at the height of the fingertips. In space the surface counts
without the underside, which nothing can touch: A, 90 % of it lies within 5 mm of the estimated surface; B, a contact
lies within 12 mm besides (half the distance of neighbouring fingertips).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from gtsam import Pose3
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.simulation.world import SimulatedWorld
from sessions.autonomous_crew import autonomous_crew
from sessions.conductor import Conductor
from sessions.conductor_settings import ConductorSettings
from sessions.decisions import Decision, End, Veto
from sessions.grasp_cycle import GraspPlan
from sessions.planner import Reorientation
from sessions.policy_choice import Choice
from sessions.policy_decisions import PolicyDecisions
from sessions.progress import GraspReport, NullProgress
from sessions.recorder import NullRecorder
from sessions.session_outcome import Ending
from sessions.thinking import Thinking
from tactile_lab.clock import NANOSECONDS
from tactile_lab.errors import ShapeError
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.shape import compare_contour, compare_mesh, horizontal_outline
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.explored import GOAL, ExploredMap
from tactile_lab.experiments.explored_objects import moved_alike
from tactile_lab.geometry.contacts import Array, Grasp
from tactile_lab.geometry.poses import transform_points
from tactile_lab.rigs.build import build_bench, simulated_world
from tactile_lab.rigs.description import load_rig
from tactile_lab.shape.sampling import sample_polygon
from tactile_lab.shape.surface import extract_mesh
from tactile_lab.slam import SlamSettings, TactileSlam
from tactile_lab.slam_result import SlamResult

OBJECTS = (
    "box-10x6x4",
    "box-12x6x6",
    "cube-6",
    "triangular-prism",
    "hexagonal-prism",
    "elliptic-cylinder",
    "l-block",
    "cylinder",
)
POLICIES = ("random", "variance", "clusters", "information")
GRASPS = 24
_RIG = "sim"
_WITHIN_m = 0.005
_CONTACT_m = 0.012
_UNDERSIDE = -0.9
_SAMPLES = 2000
_DENSE_SAMPLES = 20_000
_MESH_GRID_m = 0.005


def settings(grasps: int) -> list[Setting]:
    """Every object with every policy, in the plane and in space."""
    return grid(object=list(OBJECTS), dimension=[2, 3], policy=list(POLICIES), grasps=[grasps])


def explore_by_hand(cell: Cell) -> dict[str, Any]:
    """One session. Cell: object, dimension, policy, grasps."""
    rig, dimension = load_rig(_RIG), int(cell["dimension"])
    world = simulated_world(rig, cell.seed, cell["object"])
    bench = build_bench(rig, world, NullRecorder())
    wanted = {"method": "joint", "dimension": dimension, "motion": rig.description.motion.model_dump()}
    slam = TactileSlam(SlamSettings.model_validate(wanted), cell.seed)
    conductor = _conductor_settings(rig.description.conductor, cell["policy"], int(cell["grasps"]))
    watch = Watch(world, slam, dimension)
    bench.connect()
    try:
        crew = autonomous_crew(bench, slam, conductor, seed=cell.seed, dimension=dimension)
        crew = replace(crew, decisions=UntilExplored(crew.thinking, watch))
        outcome = Conductor(bench, conductor, crew, watch).run()
    finally:
        bench.close()
    return {**watch.figures(outcome.grasps, slam.finish()), "status": _status(outcome.ending, watch)}


def _conductor_settings(own: ConductorSettings, policy: str, grasps: int) -> ConductorSettings:
    exploration = own.exploration.model_copy(update={"policy": policy})
    return own.model_copy(update={"exploration": exploration, "grasps": grasps})


def _status(ending: Ending, watch: Watch) -> str:
    if ending is not Ending.COMPLETE:
        return str(ending)
    return "ok" if watch.is_explored else "not explored"


class Watch(NullProgress):
    """Judges a session while it runs; nothing of it reaches the session but that it may end.

    Args:
        world: the truth.
        slam: the estimation.
        dimension: 2 or 3.
    """

    def __init__(self, world: SimulatedWorld, slam: TactileSlam, dimension: int) -> None:
        self._world, self._slam, self._dimension = world, slam, dimension
        self._mesh = world.object_model.mesh
        self._true_points_m = reachable_points(self._mesh, dimension)
        self._truth: list[Pose3] = []
        self._captured = False
        self._begun_ns = world.clock.now_ns()
        self.shares: list[tuple[float, float]] = []
        """Of the surface explored after each grasp, by A and by B."""
        self.choices: dict[int, Choice] = {}
        self.grasps: list[Grasp] = []
        self._stamps_ns: list[int] = []

    @property
    def is_explored(self) -> bool:
        """By both definitions."""
        return all(self._actions(which) is not None for which in (0, 1))

    def phase(self, number: int, name: str) -> None:
        """The first step after a capture: the object is still as it was measured."""
        if self._captured:
            self._truth.append(self._world.truth().world_T_object)
        self._captured = name == "capture"

    def keep(self, choice: Choice) -> None:
        """Take note of a decision."""
        self.choices[choice.number - 1] = choice

    def grasp_done(self, report: GraspReport) -> None:
        """Look at what is explored now."""
        self._stamps_ns.append(self._world.clock.now_ns())
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
        placed = zip(self.grasps, self._slam.trajectory, self._truth, strict=False)
        parts = [(_seen(grasp, pose), _seen(grasp, true)) for grasp, pose, true in placed if pose and grasp.contacts]
        if sum(len(part[0]) for part in parts) < 3:
            return None
        estimated, true_m = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        return laid_over(self._true_points_m, true_m, estimated)

    def _actions(self, which: int) -> int | None:
        """Grasps until the goal is reached by one of the definitions; None if it was not."""
        reached = [number for number, share in enumerate(self.shares, 1) if share[which] >= GOAL]
        return reached[0] if reached else None

    def figures(self, grasps: Sequence[Grasp], result: SlamResult) -> dict[str, Any]:
        """The figures of a session that has ended."""
        points = [grasp.points_world_m for grasp in grasps]
        poses, count = result.world_T_object, min(len(result.world_T_object), len(self._truth))
        return {
            "actions_A": self._actions(0),
            "actions_B": self._actions(1),
            "share_B": self.shares[-1][1] if self.shares else 0.0,
            "minutes": (self._stamps_ns[-1] - self._begun_ns) / NANOSECONDS / 60 if self._stamps_ns else None,
            "contacts": sum(map(len, points)),
            "registration_mm": registration_rms_mm(points[:count], poses[:count], self._truth[:count], self._dimension),
            "hausdorff_mm": self._hausdorff_mm(result),
            "promises": self._kept_promises(),
        }

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
    """Follows the policy until the watch says that all is explored.

    Args:
        thinking: where the planner with the policy is asked.
        watch: what judges.
    """

    def __init__(self, thinking: Thinking, watch: Watch) -> None:
        super().__init__(thinking, watch.keep)
        self._watch = watch

    def captured(self, grasp: Grasp, plan: GraspPlan) -> Reorientation | Veto:
        self._watch.grasps.append(grasp)
        return super().captured(grasp, plan)

    def decide(self, index: int) -> Decision:
        decision = super().decide(index)
        return End("explored") if self._watch.is_explored else decision


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
