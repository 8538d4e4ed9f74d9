"""The thesis's filter on what the simulated rig records, without and with its pose graph: figures 3.20 and 3.21.

As in section 3.6 the hand grasps, turns the object in its hold, puts it down and grasps again. Every grasp follows the
fixed rule, so that all methods see the same grasps; a recording of the session would give them again, byte for byte.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import trimesh
from gtsam import Pose3

from drivers.core.contacts import Grasp
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.progress import NullProgress
from sessions.recording.recorder import NullRecorder
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.truth.rotational_symmetry import modulo_mesh_symmetry, symmetry_turns
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.data.true_surface import true_outline
from tactile_lab.experiments.run_metrics import contour_figures, mesh_figures
from tactile_lab.experiments.runs.unrecorded_session import run_unrecorded
from tactile_lab.rigs.build import build_runtime, simulated_world
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.running import slam_settings

RIG, GRASPS = "sim", 12
PLANAR_OBJECTS = ("box-10x6x4", "triangular-prism", "hexagonal-prism")
SOLID_OBJECTS = ("box-12x6x6", "cube-6", "l-block")
"""The thesis shows its own in a photograph; it says that they have faces only."""
METHODS = ("thesis-pf", "thesis-pf-graph", "joint")
_WHILE_RECORDING = "odometry"
"""The estimation that runs during the recording; nothing asks it, and it costs next to nothing."""


@dataclass(frozen=True)
class RigSession:
    """The grasps of a session on the simulated rig, and the truth.

    Attributes:
        mesh: the object, in its own frame.
        grasps: as measured.
        world_T_body: true pose of the object at each of them.
        palm_motions: how the palm moved while it carried the object, from the grasp before to each of them.
    """

    mesh: trimesh.Trimesh
    grasps: tuple[Grasp, ...]
    world_T_body: tuple[Pose3, ...]
    palm_motions: tuple[Pose3, ...]


def settings(objects: Sequence[str], dimension: int, grasps: int) -> list[Setting]:
    """Every object with each method; methods last, so that one recording serves them all."""
    return grid(object=objects, dimension=[dimension], grasps=[grasps], method=METHODS)


def estimate_on_rig(cell: Cell) -> dict[str, Any]:
    """One method on one session. Cell: object, dimension, grasps, method."""
    dimension = int(cell["dimension"])
    session = record(str(cell["object"]), cell.seed, dimension, int(cell["grasps"]))
    motion = load_rig(RIG).description.motion
    slam = TactileSlam(slam_settings(str(cell["method"]), dimension, motion), cell.seed)
    for grasp in session.grasps:
        slam.add_grasp(grasp)
    return judge(session, slam.finish())


def by_rule(rig: Rig, grasps: int) -> SessionSettings:
    """The rig's settings, but every grasp by the fixed rule, which carries the object after each.

    The objects are known to be low: nothing is probed before the first grasp.
    """
    own = rig.description.conductor
    exploration = own.exploration.model_copy(update={"policy": None})
    at_once = own.probing.model_copy(update={"top": False})
    ruled = {"exploration": exploration, "probing": at_once, "grasps": grasps, "fixed_grasps": grasps}
    return own.model_copy(update=ruled)


@lru_cache(maxsize=1)
def record(object_name: str, seed: int, dimension: int, grasps: int) -> RigSession:
    """Run a session on the simulated rig. Raises ConfigurationError for an object that it does not have."""
    rig = load_rig(RIG)
    world = simulated_world(rig, seed, object_name)
    runtime = build_runtime(rig, world, NullRecorder())
    watch = _TruthWatch(world, runtime)
    slam = TactileSlam(slam_settings(_WHILE_RECORDING, dimension, rig.description.motion), seed)
    conductor = by_rule(rig, grasps)
    roles = autonomous_roles(runtime, slam, conductor, seed=seed, dimension=dimension)
    outcome = run_unrecorded(runtime, conductor, roles, watch)
    count = min(len(outcome.grasps), len(watch.truth))
    done, truth, moved = tuple(outcome.grasps[:count]), tuple(watch.truth[:count]), tuple(watch.palm_motions[:count])
    return RigSession(world.object_model.mesh, done, truth, moved)


class _TruthWatch(NullProgress):
    """Notes the object's true pose at each capture, and how the palm moved it since the one before.

    Args:
        world: the truth.
        runtime: of the session.
    """

    def __init__(self, world: SimulatedWorld, runtime: RigRuntime) -> None:
        self._world, self._runtime, self._captured = world, runtime, False
        self._held_at: Pose3 | None = None
        self._moved = Pose3()
        self.truth: list[Pose3] = []
        self.palm_motions: list[Pose3] = []

    def phase(self, number: int, name: str) -> None:
        """The first step after a capture: the object is still as it was measured."""
        if self._captured:
            self.truth.append(self._world.truth().world_T_object)
            self.palm_motions.append(self._moved)
            self._moved = Pose3()
        self._captured = name == "capture"
        if name == "re-orient":
            self._held_at = self._runtime.perception.hand.world_T_palm
        if name == "release" and self._held_at is not None:
            self._moved = self._runtime.perception.hand.world_T_palm * self._held_at.inverse()
            self._held_at = None


def judge(session: RigSession, result: SlamResult) -> dict[str, Any]:
    """Figures of an estimation of these grasps: shape, registration, how the session went."""
    mesh, truth = session.mesh, session.world_T_body
    if result.dimension == 2:
        shape = contour_figures(result.contour, true_outline(mesh))
    else:
        shape = mesh_figures(result.mesh, mesh)
    poses = modulo_mesh_symmetry(result.world_T_object, truth, mesh, symmetry_turns(mesh))
    contacts = [grasp.points_world_m for grasp in session.grasps]
    return {
        **shape,
        "registration_mm": registration_rms_mm(contacts, poses, truth, result.dimension),
        "status": result.status,
        "grasps_done": len(session.grasps),
        "untracked": sum(step.verdict == "untracked" for step in result.steps),
    }
