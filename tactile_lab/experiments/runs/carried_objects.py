"""Objects that the simulated hand carries: how they moved, as the fingertips felt it and in truth.

The fixed rule plans the grasps, and every object is carried after each, so that the estimation has no part in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import Array, Grasp, StepSigma
from drivers.core.poses import planar
from drivers.simulation.object_names import LYING, MESH_PREFIX, in_pose
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.progress import GraspReport, NullProgress
from sessions.conductor.session_outcome import SessionOutcome
from sessions.motion.probing.box_prober import ProbingSettings
from sessions.perception.carrying.carry import Carry
from sessions.perception.interpreter import HAND_LINK
from sessions.recording.recorder import NullRecorder
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.solids import YCB_PREFIX, ycb_path
from tactile_lab.experiments.data.spoilt_samples import AS_MEASURED, SPOILT, spoil
from tactile_lab.experiments.runs.unrecorded_session import run_unrecorded
from tactile_lab.rigs.build import build_runtime, simulated_world
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.measured_law import as_normal
from tactile_lab.workflow.running import slam_settings

RIG, MASS_kg = "sim", 0.3
PALM = "palm"
"""Stands for the odometry that takes the palm's motion."""


@dataclass(frozen=True)
class WatchedCarry:
    """One carry.

    Attributes:
        by: how the object moved, by the samples of each kind of hand; of :data:`PALM`, how the palm moved.
        before, after, later: the object's true poses at the capture, when the hand opened, and at the next capture; the
            last is None for the last grasp.
        stated: standard deviations of the motion, as the next grasp states them.
    """

    by: Mapping[str, Carry]
    before: Pose2
    after: Pose2
    later: Pose2 | None
    stated: StepSigma | None


class CarryWatch(NullProgress):
    """Keeps what is true while a session runs, and what was felt.

    Args:
        world: the truth.
        runtime: of the session.
        seed: of the errors of worse hands.
    """

    def __init__(self, world: SimulatedWorld, runtime: RigRuntime, seed: int) -> None:
        self._world, self._runtime, self._seed = world, runtime, seed
        self._stamps_ns: list[int] = []
        self._poses: list[Pose2] = []
        self._palm_before = Pose3()
        self._carried: tuple[int, dict[str, Carry]] | None = None
        self.told: list[str] = []
        """What a person would have been told."""

        self._grasped: list[tuple[int, tuple[int, dict[str, Carry]] | None]] = []
        """The stamp of each capture, and when the hand opened after a carry with what was felt in it."""

    @property
    def centre_m(self) -> Array:
        """Centre of mass in the object's frame, shape (2,)."""
        return np.asarray(self._world.object_model.mesh.center_mass[:2])

    def on_sample(self, link: str, sample: object) -> None:
        """Note the truth once in each cycle."""
        if link == HAND_LINK:
            self._stamps_ns.append(self._world.clock.now_ns())
            self._poses.append(planar(self._world.plant.world_T_object))

    def on_message(self, message: str) -> None:
        """Note it."""
        self.told.append(message)

    def phase(self, number: int, name: str) -> None:
        """Note what was felt, once the carry has ended."""
        if name == "squeeze":
            self._palm_before = self._runtime.perception.hand.world_T_palm
        if name == "re-orient":
            self._carried = (0, {})
        if name == "release" and self._carried is not None:
            self._carried = self._world.clock.now_ns(), self._felt()

    def grasp_done(self, report: GraspReport) -> None:
        """The capture of this grasp was at its stamp."""
        self._grasped.append((report.stamp_ns, self._carried))
        self._carried = None

    def carries(self, grasps: Sequence[Grasp]) -> list[WatchedCarry]:
        """Every carry of the session that fingertips felt; ``grasps`` are the session's."""
        later_ns = [stamp_ns for stamp_ns, _ in self._grasped[1:]]
        stated = {grasp.stamp_ns: grasp.motion_sigma for grasp in grasps}
        found = []
        for at, (stamp_ns, carried) in enumerate(self._grasped):
            if carried is None or not carried[1]:
                continue
            then_ns = later_ns[at] if at < len(later_ns) else None
            later = None if then_ns is None else self.true_pose(then_ns)
            sigma = None if then_ns is None else stated.get(then_ns)
            found.append(WatchedCarry(carried[1], self.true_pose(stamp_ns), self.true_pose(carried[0]), later, sigma))
        return found

    def true_pose(self, stamp_ns: int) -> Pose2:
        """The object's pose on the table in the nearest cycle."""
        at = int(np.searchsorted(self._stamps_ns, stamp_ns))
        return self._poses[min(at, len(self._poses) - 1)]

    def _felt(self) -> dict[str, Carry]:
        held = self._runtime.perception.held
        if held.carry is None or held.samples is None:
            return {}
        rng = np.random.default_rng([self._seed, len(self._grasped)])
        palm = planar(self._runtime.perception.hand.world_T_palm * self._palm_before.inverse())
        spoilt = {
            how: held.odometry.estimate(spoil(held.samples, how, held.fingertips, rng))
            for how in SPOILT
            if how != AS_MEASURED
        }
        return {PALM: replace(held.carry, motion=palm), AS_MEASURED: held.carry, **spoilt}


def watch_carries(
    object_name: str,
    seed: int,
    grasps: int,
    mass_kg: float = MASS_kg,
    weighings: int = 0,
    make_watch: Callable[[SimulatedWorld, RigRuntime, int], CarryWatch] = CarryWatch,
) -> tuple[SessionOutcome, CarryWatch]:
    """A session of the fixed rule, in which the object is carried after every grasp but the last.

    Scans lie: one that stands is grasped from the side, and such a hand carries nothing.

    Args:
        object_name: of the catalogue, or a scan.
        seed: of the session.
        grasps: their number.
        mass_kg: of the object.
        weighings: how often it may be weighed.
        make_watch: makes what keeps the truth, from world, runtime and seed.

    Raises ConfigurationError: the object is a scan, and the scans are not on this machine.
    """
    rig, is_scan = _rig_with(mass_kg), object_name.startswith(YCB_PREFIX)
    world = simulated_world(rig, seed, _lying(object_name) if is_scan else object_name)
    runtime = build_runtime(rig, world, NullRecorder())
    watch = make_watch(world, runtime, seed)
    runtime.observer.interpreter.listener = watch.on_sample
    slam = TactileSlam(slam_settings("odometry", 2, rig.description.motion), seed)
    settings = _by_rule(rig, grasps, weighings, top=is_scan)
    roles = autonomous_roles(runtime, slam, settings, seed=seed, dimension=2)
    return run_unrecorded(runtime, settings, roles, watch), watch


def _lying(scan: str) -> str:
    return in_pose(f"{MESH_PREFIX}{ycb_path(scan.removeprefix(YCB_PREFIX))}", LYING)


def _rig_with(mass_kg: float) -> Rig:
    rig = load_rig(RIG)
    simulation = rig.description.simulation.model_copy(update={"object_mass_kg": mass_kg})
    return replace(rig, description=rig.description.model_copy(update={"simulation": simulation}))


def _by_rule(rig: Rig, grasps: int, weighings: int, top: bool) -> SessionSettings:
    """Settings of the fixed rule; ``top``: feel first how tall the object is, as scans may be taller than the hand."""
    usual = rig.description.conductor
    exploration = usual.exploration.model_copy(update={"policy": None})
    changes = {"grasps": grasps, "fixed_grasps": grasps + 1, "weighings": weighings}
    return usual.model_copy(update={**changes, "exploration": exploration, "probing": ProbingSettings(top=top)})


# --- figures ---------------------------------------------------------------------------------------------------


def carry_object(cell: Cell) -> dict[str, Any]:
    """The carries of one session. Cell: object, mass_kg, weighed, grasps."""
    outcome, watch = watch_carries(
        str(cell["object"]), cell.seed, int(cell["grasps"]), float(cell["mass_kg"]), int(cell["weighed"])
    )
    found = watch.carries(outcome.grasps)
    told = {"ending": str(outcome.ending), "grasps_done": len(outcome.grasps), "carries": len(found), **figures(found)}
    told["foretold"] = sum("will slip" in each for each in watch.told)
    return {**told, "worst_step_mm": max(told["as_measured_step_mm"], default=None)}


def figures(carries: Sequence[WatchedCarry]) -> dict[str, Any]:
    """Errors of all carries, and of the steps to the next capture, by kind of hand.

    Millimetres and degrees are lists: of the distances for medians, per axis for root mean squares, over the stated
    standard deviations, and as a normal distribution has them as often as the law of measured steps.
    """
    steps = [each for each in carries if each.later is not None]
    stated = [each for each in steps if each.stated is not None]
    found: dict[str, Any] = {}
    for how in (PALM, *SPOILT):
        name = how.replace(" ", "_")
        found |= _errors(f"{name}_carry", np.array([_error(each, how, each.after) for each in carries]).reshape(-1, 3))
        off = np.array([_error(each, how, each.later) for each in steps]).reshape(-1, 3)
        found |= _errors(f"{name}_step", off)
    shares = np.array([_error(each, AS_MEASURED, each.later) / _sigmas(each.stated) for each in stated]).reshape(-1, 3)
    for name, ratios in (("stated", shares), ("law", as_normal(shares))):
        found |= {f"{name}_z_mm": ratios[:, :2].ravel().tolist(), f"{name}_z_deg": ratios[:, 2].tolist()}
    return found


def _error(carry: WatchedCarry, how: str, true: Pose2 | None) -> Array:
    """Where the object is said to be by this hand's samples, minus where it is: metres, metres, radians."""
    assert true is not None
    said = carry.by[how].motion * carry.before
    return np.array([said.x() - true.x(), said.y() - true.y(), true.between(said).theta()])


def _sigmas(stated: StepSigma | None) -> Array:
    assert stated is not None
    return np.array([stated.translation_m, stated.translation_m, stated.rotation_rad])


def _errors(name: str, off: Array) -> dict[str, Any]:
    millimetres, degrees = 1e3 * off[:, :2], np.degrees(off[:, 2])
    return {
        f"{name}_mm": np.linalg.norm(millimetres, axis=1).tolist(),
        f"{name}_deg": np.abs(degrees).tolist(),
        f"{name}_axis_mm": millimetres.ravel().tolist(),
    }
