"""What is wider than the hand opens is held at its wall."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose2

from drivers.simulation.settings import ObjectStart
from drivers.simulation.world import SimulatedWorld
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_cycle import GraspCycle
from sessions.motion.motion import Motion
from sessions.motion.probing.bounding_box import BoundingBox
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.recording.recorder import NullRecorder
from tactile_lab.autonomy.autonomous_roles import hand_shape
from tactile_lab.autonomy.standing.candidate import SideReach
from tactile_lab.autonomy.standing.felt_object import FeltObject
from tactile_lab.autonomy.standing.rim_planner import RimPlanner
from tactile_lab.experiments.data.household import HOUSEHOLD
from tactile_lab.rigs.build import build_runtime
from tactile_lab.rigs.description import load_rig

RADIUS_m, HEIGHT_m = 0.060, 0.052

pytestmark = pytest.mark.long


def test_a_bowl_is_pinched_over_its_rim_and_stays_where_it_is(tmp_path: Path) -> None:
    rig, file = load_rig("sim"), tmp_path / "bowl.ply"
    HOUSEHOLD["bowl"]().export(file)
    start = ObjectStart(x_m=0.0, y_m=0.0, yaw_rad=0.2)
    world = SimulatedWorld(
        rig.description.simulation.model_copy(update={"object": f"mesh:{file}", "start": start}), seed=0
    )
    runtime = build_runtime(rig, world, NullRecorder())
    runtime.connect()
    try:
        motion = Motion(runtime, SafetySupervisor(runtime, SafetySettings(), runtime.cycle_ns))
        motion.supervisor.on_approach()
        motion.tallest_m = HEIGHT_m
        cycle, high = GraspCycle(motion, CycleSettings(), hand_shape(runtime)), np.full(2, RADIUS_m)
        felt = FeltObject(BoundingBox(Pose2(), -high, high, 0.008, HEIGHT_m, {}))
        best = RimPlanner(felt, hand_shape(runtime), (-1.31, 1.31), SideReach()).best()
        assert best is not None
        before = world.truth().world_T_object
        assert cycle.descend(best.plan)
        cycle.close()
        cycle.settle()
        grasp = cycle.capture()
        after = world.truth().world_T_object
    finally:
        runtime.close()
    assert "TH" in grasp.touching
    assert len(grasp.touching) >= 4
    assert np.linalg.norm(after.translation() - before.translation()) < 0.002
    inside = {contact.finger for contact in grasp.contacts if contact.normal_world[:2] @ contact.point_world_m[:2] < 0}
    assert inside == {"TH"}
