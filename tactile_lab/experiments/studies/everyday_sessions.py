"""Whole sessions of the simulated hand on everyday objects, standing and lying, with a user's settings.

Nothing is known of an object in advance: each session has the rig's default settings, with the estimation ``joint``.
Evaluated are how it ended, the true forces of fingertips before and during a grasp, whether the object stayed where it
was, and the model.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh
from gtsam import Pose3

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array, Grasp
from drivers.core.poses import planar, rotation_angle_rad, spatial, transform_points
from drivers.simulation.object_names import MESH_PREFIX, in_pose
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.progress import NullProgress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.perception.interpreter import HAND_LINK
from sessions.recording.recorder import NullRecorder
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.heuristic_planner import PlanSettings
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.truth.rotational_symmetry import modulo_mesh_symmetry, symmetry_turns
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.data.household import HOUSEHOLD
from tactile_lab.experiments.data.silhouettes import places, silhouettes
from tactile_lab.experiments.data.solids import MORE_YCB_NAMES, YCB_NAMES, YCB_PREFIX, ycb_path
from tactile_lab.experiments.data.true_surface import true_outline
from tactile_lab.experiments.reach.reachable import ANY_YAW_rad
from tactile_lab.experiments.reach.reached_metrics import reach_figures
from tactile_lab.experiments.run_metrics import contour_figures, mesh_figures, size_figures
from tactile_lab.experiments.runs.unrecorded_session import run_unrecorded
from tactile_lab.experiments.touched_metrics import NOTHING_TOUCHED, TouchedObject, touched_figures
from tactile_lab.rigs.build import build_runtime, simulated_world
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.shape.metrics.alignment import align_meshes
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.running import slam_settings

RIG, GRASPS = "sim", 16
LOW = "cube-6"
"""An object of the simulated rig, for comparison."""

SCANS = tuple(YCB_PREFIX + name for name in (*YCB_NAMES, *MORE_YCB_NAMES))
LAID = ("bottle", "cup")
"""Our own models that lie in another pose than they stand."""

HAND_RIGS = {"sim": "right hand, five fingers", "sim-left": "left hand", "sim-lite": "Lite hand"}
"""Rigs that differ in their hand, and which it is."""


def settings(grasps: int) -> list[Setting]:
    """Every object in space, scans also lying and in the plane."""
    return [
        *grid(object=[LOW, *HOUSEHOLD, *SCANS], pose=["standing"], dimension=[3], grasps=[grasps]),
        *grid(object=[*LAID, *SCANS], pose=["lying"], dimension=[3], grasps=[grasps]),
        *grid(object=[LOW, *SCANS], pose=["standing"], dimension=[2], grasps=[grasps]),
    ]


def settings_of_hands(grasps: int) -> list[Setting]:
    """A box on the rigs of a right hand with five fingers, a left one, and a Lite hand."""
    return grid(rig=list(HAND_RIGS), object=["box-10x6x4"], pose=["standing"], dimension=[2], grasps=[grasps])


@contextmanager
def object_name(cell: Cell) -> Iterator[str]:
    """The object of a cell as the simulated rig names it; our own models are files for so long.

    Raises ConfigurationError without the scans.
    """
    name, pose = str(cell["object"]), str(cell["pose"])
    if name.startswith(YCB_PREFIX):
        yield in_pose(f"{MESH_PREFIX}{ycb_path(name.removeprefix(YCB_PREFIX))}", pose)
    elif name in HOUSEHOLD:
        with TemporaryDirectory() as folder:
            HOUSEHOLD[name]().export(file := f"{folder}/{name}.ply")
            yield in_pose(f"{MESH_PREFIX}{file}", pose)
    else:
        yield name


def explore_everyday(cell: Cell) -> dict[str, Any]:
    """One session. Cell: object, pose, dimension, grasps; the rig, where it is not :data:`RIG`."""
    rig = load_rig(str(dict(cell.setting).get("rig", RIG)))
    with object_name(cell) as name:
        world = simulated_world(rig, cell.seed, name)
    dimension, began_s = int(cell["dimension"]), time.process_time()
    runtime, watch = build_runtime(rig, world, NullRecorder()), ForceWatch(world)
    runtime.observer.interpreter.listener = watch.on_sample
    slam = TactileSlam(slam_settings("joint", dimension, rig.description.motion), cell.seed)
    conductor = rig.description.conductor.model_copy(update={"grasps": int(cell["grasps"])})
    roles = autonomous_roles(runtime, slam, conductor, seed=cell.seed, dimension=dimension)
    outcome = run_unrecorded(runtime, conductor, roles, watch)
    result = slam.finish()
    figures = {**_ending(outcome), **watch.figures(), "cpu_minutes": (time.process_time() - began_s) / 60}
    return {**figures, **judge_model(result, outcome.grasps, watch, dimension)}


class ForceWatch(NullProgress):
    """Records the true forces of fingertips, and the object's true pose, in a running session.

    Args:
        world: the truth.
    """

    def __init__(self, world: SimulatedWorld) -> None:
        self._world, self._phase = world, ""
        self._first_ns, self._first = world.clock.now_ns(), world.truth().world_T_object
        self._most_N, self._most_link_N = {True: 0.0, False: 0.0}, 0.0
        self.truth: list[Pose3] = []
        """The object's pose at each capture."""

        self.mesh = world.object_model.mesh

    def phase(self, number: int, name: str) -> None:
        """The first step after a capture: the object is still as it was measured."""
        if self._phase == "capture":
            self.truth.append(self._world.truth().world_T_object)
        self._phase = name

    def on_sample(self, link: str, sample: object) -> None:
        """Record the truth once per cycle."""
        if link == HAND_LINK:
            grasping = self._phase in ("close", "capture", "squeeze", "re-orient", "release")
            forces_N: dict[str, Array] = defaultdict(lambda: np.zeros(3))
            for contact in self._world.plant.contacts():
                if contact.touched == "object":
                    forces_N[contact.finger] += contact.force_on_tip_world_N
            loads_N = (float(np.linalg.norm(force)) for force in forces_N.values())
            self._most_N[grasping] = max([self._most_N[grasping], *loads_N])
            if not grasping:
                self._most_link_N = max([self._most_link_N, *self._world.plant.link_loads_N().values()])

    def figures(self) -> dict[str, Any]:
        """Forces, displacement of the object, and simulated time of the session."""
        moved = self._first.inverse() * self._world.truth().world_T_object
        return {
            "outside_N": self._most_N[False],
            "link_N": self._most_link_N,
            "grasp_N": self._most_N[True],
            "moved_mm": 1e3 * float(np.linalg.norm(moved.translation())),
            "turned_deg": float(np.degrees(rotation_angle_rad(moved))),
            "minutes": (self._world.clock.now_ns() - self._first_ns) / NANOSECONDS / 60,
        }


def _ending(outcome: SessionOutcome) -> dict[str, Any]:
    in_order = outcome.ending in (Ending.COMPLETE, Ending.PARTIAL)
    return {
        "ending": str(outcome.ending),
        "reason": outcome.reason,
        "in_order": in_order,
        "grasps_done": len(outcome.grasps),
        "contacts": sum(len(grasp.contacts) for grasp in outcome.grasps),
        "status": "ok" if in_order else str(outcome.ending),
    }


def judge_model(result: SlamResult, grasps: Sequence[Grasp], watch: ForceWatch, dimension: int) -> dict[str, Any]:
    """The model against the truth: everywhere, and in space also over what was touched, with a picture's lines."""
    seen = _as_it_lies(result, grasps, watch)
    mesh, truth, done = seen.mesh, seen.world_T_body, seen.grasps
    registration_mm = registered_mm(seen, dimension) if done else None
    shape = _shape_figures(result, mesh, dimension)
    figures = {**shape, "registration_mm": registration_mm, **NOTHING_TOUCHED}
    if dimension == 3:
        figures |= reach_figures(result.mesh, mesh, _yaws_rad(truth))
    if dimension == 3 and any(grasp.contacts for grasp in done):
        return {**figures, **touched_figures(seen, result), **_picture(result, seen)}
    return figures


def _shape_figures(result: SlamResult, mesh: trimesh.Trimesh, dimension: int) -> dict[str, Any]:
    if dimension == 2:
        outline_m = true_outline(mesh)
        return contour_figures(result.contour, outline_m) | size_figures(result.contour, outline_m)
    return mesh_figures(result.mesh, mesh) | size_figures(result.mesh, np.asarray(mesh.vertices))


@dataclass(frozen=True)
class SeenObject(TouchedObject):
    """An object with its true and estimated poses at the grasps that the model is made of."""

    estimate: Sequence[Pose3 | None] = ()


def registered_mm(seen: SeenObject, dimension: int) -> float | None:
    """How well contacts fit together, in millimetres; rotations of a round object about its axis do not count, as in
    the evaluation of a session.
    """
    points = [grasp.points_world_m for grasp in seen.grasps]
    poses = modulo_mesh_symmetry(seen.estimate, seen.world_T_body, seen.mesh, symmetry_turns(seen.mesh))
    return registration_rms_mm(points, poses, seen.world_T_body, dimension)


def _as_it_lies(result: SlamResult, grasps: Sequence[Grasp], watch: ForceWatch) -> SeenObject:
    """The object as it stood or, after a fall, lay when the model was made: its mesh upright there, and the grasps."""
    count = min(len(result.world_T_object), len(watch.truth), len(grasps))
    falls = [0, *(place for place, grasp in enumerate(grasps[:count]) if grasp.begins_anew)]
    last = max((place for place, pose in enumerate(result.world_T_object[:count]) if pose is not None), default=count)
    begun = max(place for place in falls if place <= last)
    count = min((place for place in falls if place > begun), default=count)
    lying = spatial(planar(watch.truth[begun])).inverse() * watch.truth[begun] if begun else Pose3()
    mesh = trimesh.Trimesh(transform_points(lying, watch.mesh.vertices), watch.mesh.faces, process=False)
    truth = [pose * lying.inverse() for pose in watch.truth[begun:count]]
    return SeenObject(mesh, truth, grasps[begun:count], result.world_T_object[begun:count])


def _yaws_rad(world_T_body: Sequence[Pose3]) -> list[tuple[float, float]]:
    """Of the hand, seen from the object in each of its poses; any if there is none."""
    low, high = PlanSettings().yaw_window_rad
    headings_rad = [planar(pose).theta() for pose in world_T_body]
    return [(low - heading, high - heading) for heading in headings_rad] or [ANY_YAW_rad]


def _picture(result: SlamResult, seen: SeenObject) -> dict[str, Any]:
    """Silhouettes of the object and of the model laid over it, and where contacts were, in the object's frame."""
    pairs = list(zip(seen.world_T_body, seen.grasps, strict=False))
    by_kind = {
        kind: np.vstack(
            [np.empty((0, 3)), *(transform_points(pose.inverse(), _points(grasp, probed)) for pose, grasp in pairs)]
        )
        for kind, probed in (("closed", False), ("probed", True))
    }
    shown = {"true": silhouettes(seen.mesh), **{kind: places(points_m) for kind, points_m in by_kind.items()}}
    if result.mesh is not None:
        fit = align_meshes(result.mesh, seen.mesh, upright=True)
        moved = trimesh.Trimesh(transform_points(fit, result.mesh.vertices), result.mesh.faces, process=False)
        shown["model"] = silhouettes(moved)
    return {"picture": shown}


def _points(grasp: Grasp, probed: bool) -> Array:
    return np.array([c.point_world_m for c in grasp.contacts if c.probed == probed]).reshape(-1, 3)
