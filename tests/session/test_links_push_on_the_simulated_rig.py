"""Foresight and guard agree: with a link in the object the hand stays higher, and no object is moved or pressed."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.simulation.settings import ObjectStart
from drivers.simulation.world import SimulatedWorld
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.motion import Motion
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.recording.recorder import Recorder
from tactile_lab.autonomy.autonomous_roles import hand_shape
from tactile_lab.autonomy.clearance.collision_check import links_are_clear, standing
from tactile_lab.experiments.thesis.rig_sessions import record
from tactile_lab.rigs.build import build_runtime
from tactile_lab.rigs.description import load_rig
from tests.support.box_shapes import solid_box


class Forgetful:
    """Where nothing is kept that was written."""

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        pass


@pytest.mark.parametrize(("height_m", "clear"), [(0.018, False), pytest.param(0.034, True, marks=pytest.mark.long)])
def test_the_hand_comes_down_over_a_cube_of_6_cm_as_far_as_its_links_are_clear(height_m: float, clear: bool) -> None:
    rig = load_rig("sim")
    start = ObjectStart(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    simulation = rig.description.simulation.model_copy(update={"object": "cube-6", "start": start})
    world = SimulatedWorld(simulation, 0)
    runtime = build_runtime(rig, world, Recorder(Forgetful()))
    plan = GraspPlan(GraspFrame(0.0, 0.0, 0.0), "radial", height_m)
    runtime.connect()
    try:
        motion = Motion(runtime, SafetySupervisor(runtime, SafetySettings(), runtime.cycle_ns))
        cycle = GraspCycle(motion, CycleSettings(), hand_shape(runtime))
        pressed_N, before = [0.0], world.truth().world_T_object
        motion.supervisor.on_approach()
        motion.tallest_m = 0.060
        runtime.observer.interpreter.listener = lambda link, sample: pressed_N.extend(
            world.plant.link_loads_N().values()
        )
        assert cycle.descend(plan)
        assert (cycle.plan.height_m == height_m) is clear
        most_N = max(pressed_N)
        cycle.close()
        cycle.settle()
        moved_m = np.linalg.norm((world.truth().world_T_object.translation() - before.translation())[:2])
    finally:
        runtime.close()
    known = standing(solid_box(0.060, 0.030, 0.030), Pose2(), 0.060)
    assert known is not None
    assert bool(links_are_clear([plan], hand_shape(runtime), known)[0]) is clear
    assert moved_m < 0.002
    assert most_N < 1.6
    assert all(np.linalg.norm(place[:2]) < 0.001 for place in cycle.landings_world_m)


@pytest.mark.long  # quicker: how far the hand comes down over a cube, above
def test_a_grasp_whose_links_land_is_done_higher_where_nobody_has_felt_how_tall_the_object_is() -> None:
    first, second = record("hexagonal-prism", 61, 3, 2).grasps
    assert min(len(first.touching), len(second.touching)) >= 3
