"""How fast the hand comes down where links may land, and up from beside an object, on a world without physics."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.shadow.closing.hand_envelope import lowest_inside_m
from sessions.motion.arrival import Arrival, Place
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tests.support.disc_world import DiscWorld
from tests.support.motion_trace import TIP, grasp_cycle

SETTINGS = CycleSettings()
PLAN = GraspPlan(GraspFrame(0.0, 0.0, 0.0), "radial", 0.018)
PASSED_OVER_m = 0.08
"""Nothing taller may stand there if nobody has felt how tall it is."""


def slow_from_m(top_m: float | None) -> float:
    """How far above a grasp the hand begins to come down as slowly as links may land."""
    heights_m: list[float] = []
    world = DiscWorld(None, lambda world: heights_m.append(float(world.base_q[2])))
    _, motion = grasp_cycle(world)
    motion.supervisor.on_approach()
    motion.tallest_m = top_m
    place = Place.of(PLAN, TIP)
    motion.set_base(motion.base_joints(place.frame, place.table, SETTINGS.lift_m))
    motion.tick()
    heights_m.clear()
    assert Arrival(motion, SETTINGS, TIP).come_down(place) == ()
    slowly = -np.diff(heights_m) < 1.01 * SETTINGS.links_landing_m_s * motion.cycle_s
    return heights_m[int(np.argmax(slowly))] - heights_m[-1]


@pytest.mark.parametrize("top_m", [0.04, 0.06, None])
def test_links_come_down_slowly_from_the_top_or_from_as_high_as_an_unknown_one_can_be(top_m: float | None) -> None:
    expected_m = (PASSED_OVER_m if top_m is None else top_m) + 0.005 - lowest_inside_m(PLAN.closing, 0.018, TIP)
    assert slow_from_m(top_m) == pytest.approx(max(0.0, expected_m), abs=1e-3)


@pytest.mark.parametrize(("begin_m", "is_slow"), [(0.0, True), (0.15, False)])
def test_the_hand_rises_slowly_while_a_fingertip_may_be_under_a_rim(begin_m: float, is_slow: bool) -> None:
    heights_m: list[float] = []
    world = DiscWorld(None, lambda world: heights_m.append(float(world.base_q[2])))
    _, motion = grasp_cycle(world)
    motion.tallest_m = 0.06
    place = Place.of(PLAN, TIP)
    motion.set_base(motion.base_joints(place.frame, place.table, begin_m))
    motion.tick()
    heights_m.clear()
    Arrival(motion, SETTINGS, TIP).come_up(place)
    rises_m = np.diff(heights_m)
    assert (rises_m.sum() > 0.03) == is_slow
    assert (rises_m < 1.01 * SETTINGS.approach_m_s * motion.cycle_s).all()
