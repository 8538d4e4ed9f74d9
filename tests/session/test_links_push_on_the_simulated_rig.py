"""Physics and foresight agree: a grasp with a link in the object moves it, one that keeps its links off leaves it."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.simulation.settings import ObjectStart
from drivers.simulation.world import SimulatedWorld
from sessions.autonomous_crew import tip_shape
from sessions.cycle_settings import CycleSettings
from sessions.grasp_cycle import GraspCycle
from sessions.grasp_plan import GraspPlan
from sessions.link_clearance import links_are_clear, standing
from sessions.motion import GraspFrame, Motion
from sessions.recorder import Recorder
from sessions.safety import SafetySettings, SafetySupervisor
from tactile_lab.rigs.build import build_bench
from tactile_lab.rigs.description import load_rig
from tests.support.box_shapes import solid_box


class Forgetful:
    """Where nothing is kept that was written."""

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        pass


@pytest.mark.parametrize(("height_m", "clear"), [(0.018, False), (0.034, True)])
def test_a_cube_of_6_cm_is_pushed_by_links_or_left_where_it_is(height_m: float, clear: bool) -> None:
    rig = load_rig("sim")
    start = ObjectStart(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    simulation = rig.description.simulation.model_copy(update={"object": "cube-6", "start": start})
    world = SimulatedWorld(simulation, 0)
    bench = build_bench(rig, world, Recorder(Forgetful()))
    plan = GraspPlan(GraspFrame(0.0, 0.0, 0.0), "radial", height_m)
    bench.connect()
    try:
        motion = Motion(bench, SafetySupervisor(bench, SafetySettings(), bench.cycle_ns))
        cycle = GraspCycle(motion, CycleSettings(), tip_shape(bench))
        before = world.truth().world_T_object
        assert cycle.descend(plan)
        cycle.close()
        cycle.settle()
        moved_m = np.linalg.norm((world.truth().world_T_object.translation() - before.translation())[:2])
    finally:
        bench.close()
    known = standing(solid_box(0.060, 0.030, 0.030), Pose2(), 0.060)
    assert known is not None
    assert bool(links_are_clear([plan], tip_shape(bench), known)[0]) is clear
    assert bool(moved_m < 0.002) is clear
