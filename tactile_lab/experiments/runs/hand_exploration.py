"""Exploration by the simulated hand: policies over the hand's own candidates in whole sessions; truth for evaluation
only.

Hand, sensors, contacts and friction are the simulated rig's; see
:mod:`tactile_lab.experiments.runs.kinematic_exploration` for the same without physics.
:mod:`tactile_lab.experiments.runs.coverage_monitor` defines what counts as explored.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from drivers.core.clock import NANOSECONDS
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.progress import GraspReport, NullProgress
from sessions.recording.recorder import NullRecorder
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.slam_service import SlamService
from tactile_lab.experiments.cells import Cell, Setting, grid
from tactile_lab.experiments.runs.coverage_monitor import CoverageMonitor, UntilExplored
from tactile_lab.experiments.runs.unrecorded_session import run_unrecorded
from tactile_lab.rigs.build import build_runtime, simulated_world
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam

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
ACTIONS = 24
RIG = "sim"


def settings(actions: int) -> list[Setting]:
    """Every object with every policy, in the plane and in space, with a budget of actions."""
    return grid(object=list(OBJECTS), dimension=[2, 3], policy=list(POLICIES), actions=[actions])


def explore_by_hand(cell: Cell) -> dict[str, Any]:
    """One session. Cell: object, dimension, policy, actions."""
    rig, dimension = load_rig(RIG), int(cell["dimension"])
    world = simulated_world(rig, cell.seed, cell["object"])
    runtime = build_runtime(rig, world, NullRecorder())
    slam, conductor = estimation(rig, cell), conductor_settings(rig, cell)
    roles = autonomous_roles(runtime, slam, conductor, seed=cell.seed, dimension=dimension)
    shape = partial(roles.estimator.ask, SlamService.known_shape)
    monitor = CoverageMonitor(world.object_model.mesh, slam, shape, dimension, int(cell["actions"]))
    roles = replace(roles, decisions=UntilExplored(roles.estimator, monitor))
    outcome = run_unrecorded(runtime, conductor, roles, Watch(world, monitor))
    return {**monitor.figures(slam.finish()), "status": monitor.status(str(outcome.ending))}


def estimation(rig: Rig, cell: Cell) -> TactileSlam:
    """The default method, with the motion noise of the rig's objects."""
    wanted = {"method": "joint", "dimension": cell["dimension"], "motion": rig.description.motion.model_dump()}
    return TactileSlam(SlamSettings.model_validate(wanted), cell.seed)


def conductor_settings(rig: Rig, cell: Cell) -> SessionSettings:
    """The rig's settings, with the cell's policy; every grasp is at least one action.

    The objects are known to be low, so there is no probing before the first grasp, as in the thesis.
    """
    own = rig.description.conductor
    exploration = own.exploration.model_copy(update={"policy": cell["policy"]})
    at_once = own.probing.model_copy(update={"top": False})
    return own.model_copy(update={"exploration": exploration, "grasps": int(cell["actions"]), "probing": at_once})


class Watch(NullProgress):
    """Passes the state of a running session on the simulated rig to its monitor.

    Args:
        world: the truth.
        monitor: the session's monitor.
    """

    def __init__(self, world: SimulatedWorld, monitor: CoverageMonitor) -> None:
        self._world, self._monitor = world, monitor
        self._captured = False
        self._begun_ns = world.clock.now_ns()

    def phase(self, number: int, name: str) -> None:
        """The first step after a capture: the object is still as it was measured."""
        if self._captured:
            self._monitor.truth.append(self._world.truth().world_T_object)
        self._captured = name == "capture"

    def grasp_done(self, report: GraspReport) -> None:
        """Update the coverage."""
        self._monitor.look((self._world.clock.now_ns() - self._begun_ns) / NANOSECONDS / 60)
