"""One finger in a cup, to its floor and against its walls, and on a bottle's cap: gently, and nothing is moved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh

from drivers.core.contacts import Array, Contact, Grasp
from drivers.core.poses import transform_points
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.settings import ObjectStart
from drivers.simulation.world import SimulatedWorld
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan, Opening
from sessions.motion.motion import Motion
from sessions.motion.probing.touch_patterns import TAP, TAP_HEIGHT_m
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.recording.recorder import NullRecorder
from tactile_lab.autonomy.autonomous_roles import hand_shape
from tactile_lab.experiments.data.household import HOUSEHOLD, turned
from tactile_lab.experiments.studies.everyday_sessions import ForceWatch
from tactile_lab.rigs.build import build_runtime, simulation_settings
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh

HIGH_m, INNER_m, FLOOR_m = 0.075, 0.034, 0.008
CUP = turned([0, 38, 38, 34, 34, 0], [0, 0, 75, 75, 8, 8])
BOTTLE, BOTTLE_m = HOUSEHOLD["bottle"](), 0.130


@dataclass(frozen=True)
class Touched:
    """What a touch met, the object where it stood, and what became of it."""

    grasp: Grasp
    mesh: trimesh.Trimesh
    moved_m: float
    forces: dict[str, float]

    def facing_up(self) -> list[Contact]:
        """Contacts that face up."""
        return [contact for contact in self.grasp.contacts if contact.normal_world[2] > 0.7]


def touch(folder: Path, rig_name: str, plan: GraspPlan, mesh: trimesh.Trimesh, high_m: float) -> Touched:
    """One touch of an object in the middle of the table."""
    mesh.export(file := folder / "object.ply")
    rig = load_rig(rig_name)
    start = ObjectStart(x_m=0.0, y_m=0.0, yaw_rad=0.2)
    settings = simulation_settings(rig, f"mesh:{file}").model_copy(update={"start": start})
    calibration = SimulatedCalibration.of_hand(settings.fingertips, rig.files["fingertips"], rig.files["motors"])
    world = SimulatedWorld(settings, 0, calibration)
    runtime, watch = build_runtime(rig, world, NullRecorder()), ForceWatch(world)
    runtime.observer.interpreter.listener = watch.on_sample
    runtime.connect()
    try:
        motion = Motion(runtime, SafetySupervisor(runtime, SafetySettings(), runtime.cycle_ns))
        motion.supervisor.on_approach()
        motion.tallest_m = high_m
        cycle, before = GraspCycle(motion, CycleSettings(), hand_shape(runtime)), world.truth().world_T_object
        assert cycle.descend(plan)
        grasp, after = cycle.capture(), world.truth().world_T_object
    finally:
        runtime.close()
    stood = world.object_model.mesh
    stood = trimesh.Trimesh(transform_points(before, stood.vertices), stood.faces, process=False)
    return Touched(grasp, stood, float(np.linalg.norm(after.translation() - before.translation())), watch.figures())


def touch_cup(folder: Path, rig_name: str, aside_m: float) -> Touched:
    """One touch inside, so far beside the cup's middle."""
    frame, opening = GraspFrame(aside_m, 0.0, 0.4), Opening(INNER_m, HIGH_m, 0.004)
    plan = GraspPlan(frame, TAP.closing, TAP_HEIGHT_m, only_touch=True, opening=opening)
    return touch(folder, rig_name, plan, CUP, HIGH_m)


def places_m(contacts: list[Contact]) -> Array:
    return np.array([contact.point_world_m for contact in contacts])


@pytest.mark.parametrize(("rig_name", "aside_m"), [("sim", 0.0), ("sim", 0.008), ("sim-left", 0.0), ("sim-lite", 0.0)])
def test_floor_and_both_walls_of_a_cup_are_touched_gently(tmp_path: Path, rig_name: str, aside_m: float) -> None:
    touched = touch_cup(tmp_path, rig_name, aside_m)
    assert {contact.finger for contact in touched.grasp.contacts} == {"FF"}
    assert touched.facing_up()
    assert places_m(touched.facing_up())[:, 2] == pytest.approx(FLOOR_m, abs=0.004)
    walls = [contact for contact in touched.grasp.contacts if abs(contact.normal_world[2]) < 0.4]
    along = places_m(walls)[:, :2] @ [np.cos(0.4), np.sin(0.4)]
    assert np.count_nonzero(along > 0) == np.count_nonzero(along < 0) == 2
    assert np.ptp(along[along > 0].mean() - along[along < 0]) < 0.006
    assert along[along > 0].mean() - along[along < 0].mean() == pytest.approx(2 * INNER_m, abs=0.003)
    assert distances_to_mesh(places_m(walls), touched.mesh).mean() < 0.005
    assert touched.forces["outside_N"] < 0.8
    assert touched.forces["link_N"] < 0.1
    assert touched.moved_m < 0.0005


def test_a_link_on_the_rim_ends_it_and_nothing_is_pressed_against(tmp_path: Path) -> None:
    touched = touch_cup(tmp_path, "sim", aside_m=0.030)
    assert touched.forces["outside_N"] < 0.8
    assert touched.forces["link_N"] < 2.0
    assert touched.moved_m < 0.002


def test_a_bottles_cap_is_touched_from_above_by_one_finger(tmp_path: Path) -> None:
    plan = GraspPlan(GraspFrame(0.0, 0.0, 0.4), TAP.closing, TAP_HEIGHT_m, only_touch=True, down_to_m=BOTTLE_m - 0.03)
    touched = touch(tmp_path, "sim", plan, BOTTLE, BOTTLE_m)
    assert [contact.finger for contact in touched.grasp.contacts] == ["FF"]
    assert len(touched.facing_up()) == 1
    assert distances_to_mesh(places_m(touched.facing_up()), touched.mesh)[0] < 0.003
    assert touched.forces["outside_N"] < 0.8
    assert touched.forces["link_N"] < 0.1
    assert touched.moved_m < 0.0005
