"""Whole sessions of the simulated hand on scanned household objects, standing and lying, with a user's settings.

Nothing is known of an object in advance: each session has the rig's default settings, with the estimation ``joint``.
Evaluated are how it ended, the true forces of fingertips before and during a grasp, whether the object stayed where it
was, and the model.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.core.clock import NANOSECONDS
from drivers.core.poses import rotation_angle_rad
from drivers.simulation.object_names import MESH_PREFIX, in_pose
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.conductor import Conductor
from sessions.conductor.progress import NullProgress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.perception.interpreter import HAND_LINK
from sessions.recording.recorder import NullRecorder
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.data.solids import YCB_NAMES, YCB_PREFIX, ycb_path
from tactile_lab.experiments.data.true_surface import true_outline
from tactile_lab.experiments.run_metrics import contour_figures, mesh_figures
from tactile_lab.rigs.build import build_runtime, simulated_world
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.running import slam_settings

RIG, GRASPS = "sim", 16
LOW = "cube-6"
"""An object of the simulated rig, for comparison."""

HAND_RIGS = {"sim": "right hand, five fingers", "sim-left": "left hand", "sim-lite": "Lite hand"}
"""Rigs that differ in their hand, and which it is."""

POSES = ("standing", "lying")


def settings(grasps: int) -> list[Setting]:
    """Every scan in both poses, and the low object, in space; standing ones in the plane too."""
    scans = [YCB_PREFIX + name for name in YCB_NAMES]
    return [
        *grid(object=[LOW, *scans], pose=["standing"], dimension=[3, 2], grasps=[grasps]),
        *grid(object=scans, pose=["lying"], dimension=[3], grasps=[grasps]),
    ]


def settings_of_hands(grasps: int) -> list[Setting]:
    """A box on the rigs of a right hand with five fingers, a left one, and a Lite hand."""
    return grid(rig=list(HAND_RIGS), object=["box-10x6x4"], pose=["standing"], dimension=[2], grasps=[grasps])


def object_name(cell: Cell) -> str:
    """The object of a cell as the simulated rig names it. Raises ConfigurationError without the scans."""
    name = str(cell["object"])
    if not name.startswith(YCB_PREFIX):
        return name
    return in_pose(f"{MESH_PREFIX}{ycb_path(name.removeprefix(YCB_PREFIX))}", str(cell["pose"]))


def explore_everyday(cell: Cell) -> dict[str, Any]:
    """One session. Cell: object, pose, dimension, grasps; the rig, where it is not :data:`RIG`."""
    rig, dimension = load_rig(str(dict(cell.setting).get("rig", RIG))), int(cell["dimension"])
    world = simulated_world(rig, cell.seed, object_name(cell))
    runtime, watch = build_runtime(rig, world, NullRecorder()), ForceWatch(world)
    runtime.observer.interpreter.listener = watch.on_sample
    slam = TactileSlam(slam_settings("joint", dimension, rig.description.motion), cell.seed)
    conductor = rig.description.conductor.model_copy(update={"grasps": int(cell["grasps"])})
    runtime.connect()
    try:
        roles = autonomous_roles(runtime, slam, conductor, seed=cell.seed, dimension=dimension)
        outcome = Conductor(runtime, conductor, roles, watch).run()
    finally:
        runtime.close()
    return {**_ending(outcome), **watch.figures(), **_model(slam.finish(), outcome, watch, dimension)}


class ForceWatch(NullProgress):
    """Records the true forces of fingertips, and the object's true pose, in a running session.

    Args:
        world: the truth.
    """

    def __init__(self, world: SimulatedWorld) -> None:
        self._world, self._phase = world, ""
        self._first_ns, self._first = world.clock.now_ns(), world.truth().world_T_object
        self._most_N = {True: 0.0, False: 0.0}
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
            forces_N = [contact.force_N for contact in self._world.truth().contacts]
            self._most_N[grasping] = max([self._most_N[grasping], *forces_N])

    def figures(self) -> dict[str, Any]:
        """Forces, displacement of the object, and simulated time of the session."""
        moved = self._first.inverse() * self._world.truth().world_T_object
        return {
            "outside_N": self._most_N[False],
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


def _model(result: SlamResult, outcome: SessionOutcome, watch: ForceWatch, dimension: int) -> dict[str, Any]:
    mesh, poses = watch.mesh, result.world_T_object
    count = min(len(poses), len(watch.truth), len(outcome.grasps))
    points = [grasp.points_world_m for grasp in outcome.grasps[:count]]
    shape = contour_figures(result.contour, true_outline(mesh)) if dimension == 2 else mesh_figures(result.mesh, mesh)
    registration = registration_rms_mm(points, poses[:count], watch.truth[:count], dimension) if count else None
    return {**shape, "registration_mm": registration}
