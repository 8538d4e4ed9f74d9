"""What the hand does in whole manoeuvres, cycle by cycle, in a world of discs: compared with before.

Speeds, forces, orders and limits all leave a trace; what each of them is for, other tests say.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.probing.box_prober import BoxProber, ProbingSettings
from sessions.motion.probing.raking import Raker
from tests.support.baseline import assert_baseline
from tests.support.disc_world import Disc
from tests.support.motion_trace import TIP, TracedWorld, grasp_cycle
from tests.support.said import as_name

AT = GraspFrame(0.004, -0.003, 0.3)
BRISK = CycleSettings(finger_rad_s=6.0, travel_m_s=0.6, turn_rad_s=4.0)
"""Ways through free space are short; the rest is as on every rig."""
WINDOW_rad = (-1.31, 1.31)
CLOSE = {"rtol": 2e-5, "atol": 5e-6}
"""The closings' paths are found by a search, which ends a tenth of this elsewhere on another processor."""


def low(x_m: float = 0.003, y_m: float = -0.004, **shape: float) -> Disc:
    return Disc(np.array([x_m, y_m]), **shape)


PLANS = {
    "pinch after a tap": (low(), GraspPlan(AT, "pinch", 0.022, tap=True)),
    "radial": (low(), GraspPlan(AT, "radial", 0.03)),
    "from the left after a touch": (
        low(radius_m=0.025, height_m=0.15),
        GraspPlan(AT, "pinch-from-left", 0.045, tap=True),
    ),
    "from the right": (low(radius_m=0.025, height_m=0.15), GraspPlan(AT, "radial-from-right", 0.06)),
}


@pytest.mark.parametrize("name", PLANS)
def test_a_whole_grasp(name: str) -> None:
    disc, plan = PLANS[name]
    world = TracedWorld(disc)
    cycle, motion = grasp_cycle(world, CycleSettings() if plan.closing == "pinch" else BRISK)
    motion.tallest_m = disc.height_m
    told: dict[str, Any] = {"arrived": cycle.descend(plan)}
    if told["arrived"]:
        cycle.close()
        told["touching"], told["progress"] = cycle.fingers.touching, dict(cycle.fingers.progress)
        cycle.settle()
        grasp = cycle.capture()
        told["contacts"] = [[c.finger, c.probed, c.force_N, c.point_world_m, c.normal_world] for c in grasp.contacts]
        told["foretold"] = cycle.forecast(grasp, 0.3, np.array([0.01, -0.005]))
        cycle.squeeze(grasp.touching)
        told["carried"] = cycle.reorient(0.3, np.array([0.01, -0.005]), grasp.touching).matrix()[:3]
        if plan.closing == "pinch":
            told["weighed"] = str(cycle.weigh(grasp.touching).end)
        world.part("release")
        cycle.release()
        world.part("lift")
        cycle.lift()
    told |= {"landings": cycle.landings_world_m, "jammed": cycle.jammed, "trace": world.summary()}
    assert_baseline(f"sessions/motion/grasp_{as_name(name)}", told, **CLOSE)


LANDINGS = {
    "on a finger's side": (low(0.0, 0.05), GraspPlan(AT, "pinch", 0.022)),
    "on the thumb's side": (low(-0.05, -0.02), GraspPlan(AT, "radial", 0.022)),
    "on both": (low(0.0, 0.0, radius_m=0.085), GraspPlan(AT, "pinch", 0.022)),
    "on both, with little room to turn": (low(0.0, 0.0, radius_m=0.085), GraspPlan(AT, "pinch", 0.022)),
    "from the side": (low(0.0, 0.09, radius_m=0.05, height_m=0.15), GraspPlan(AT, "pinch-from-left", 0.045)),
    "on the way in": (low(0.0, 0.03, radius_m=0.045, height_m=0.15), GraspPlan(AT, "radial-from-left", 0.045)),
    "only a touch from above": (low(height_m=0.05), GraspPlan(AT, "radial", 0.022, only_touch=True)),
    "only a touch from the side": (
        low(height_m=0.15),
        GraspPlan(AT, "pinch-from-right", 0.05, only_touch=True),
    ),
    "only a touch of what stands too near": (
        low(0.0, -0.10, radius_m=0.06, height_m=0.15),
        GraspPlan(AT, "pinch-from-right", 0.05, only_touch=True),
    ),
}


@pytest.mark.parametrize("name", LANDINGS)
def test_an_approach_that_meets_something(name: str) -> None:
    disc, plan = LANDINGS[name]
    world = TracedWorld(disc)
    cycle, motion = grasp_cycle(world, BRISK, (0.1, 0.9) if "little room" in name else WINDOW_rad)
    motion.supervisor.on_approach()
    motion.tallest_m = disc.height_m
    arrived = cycle.descend(plan)
    plan = cycle.plan
    told = {"arrived": arrived, "landings": cycle.landings_world_m, "plan": plan.as_plain(0)}
    probed = [[c.finger, c.force_N, c.point_world_m] for c in world.perception.probed]
    assert_baseline(
        f"sessions/motion/approach_{as_name(name)}", told | {"probed": probed, "trace": world.summary()}, **CLOSE
    )


BOXES = {
    "sides wanted": (low(0.01, -0.005, height_m=0.045), ProbingSettings(enabled=True, lanes_m=(0.03,))),
    "top aside": (low(0.0, -0.05, radius_m=0.02), ProbingSettings()),
    "too wide": (low(0.0, 0.0, radius_m=0.16), ProbingSettings(enabled=True, lanes_m=(0.0,))),
    "tall": (low(0.02, -0.015, height_m=0.15), ProbingSettings(lanes_m=(0.0,))),
}


@pytest.mark.parametrize("name", BOXES)
def test_a_bounding_box(name: str) -> None:
    disc, settings = BOXES[name]
    world = TracedWorld(disc)
    _, motion = grasp_cycle(world, BRISK)
    motion.supervisor.on_approach()
    box = BoxProber(Raker(motion, BRISK, TIP), settings, WINDOW_rad, (0.002, 0.001)).feel()
    axes = box.world_T_box
    told = {
        "box": [axes.x(), axes.y(), axes.theta(), box.low_m, box.high_m, box.margin_m, box.top_m, box.has_sides],
        "missing": dict(box.missing),
        "words": box.in_words(),
        "tallest_m": motion.tallest_m,
    }
    assert_baseline(f"sessions/motion/box_{as_name(name)}", told | {"trace": world.summary()}, **CLOSE)
