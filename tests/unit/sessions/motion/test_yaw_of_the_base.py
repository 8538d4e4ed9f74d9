"""A hand that goes around an object again and again does not turn its axis to the end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.positioner.kinematics import mount_T_forearm
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.motion import Motion
from sessions.motion.probing.touching import Toucher
from tests.support.disc_world import DiscWorld
from tests.support.motion_trace import TIP, grasp_cycle

MOST_rad = 1.5 * np.pi
QUICK = CycleSettings(finger_rad_s=20.0, travel_m_s=1.0, turn_rad_s=5.0)


def motion_on(world: DiscWorld) -> Motion:
    _, motion = grasp_cycle(world)
    motion.supervisor.on_approach()
    return motion


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_a_place_is_unwound_to_the_same_place(now_rad: float, then_rad: float) -> None:
    motion = motion_on(DiscWorld(None))
    motion.set_base(np.array([0.0, 0.0, 0.4, now_rad, 0.0, 0.0]))
    there = np.array([0.1, 0.2, 0.4, then_rad, 0.3, 1.5])
    unwound = motion.unwound(there)
    assert abs(unwound[3]) <= MOST_rad + 1e-9
    assert mount_T_forearm(unwound).equals(mount_T_forearm(there), 1e-9)


def test_where_the_axis_is_near_its_middle_the_hand_goes_the_short_way() -> None:
    motion = motion_on(DiscWorld(None))
    motion.set_base(np.array([0.0, 0.0, 0.4, 1.4, 0.0, 0.0]))
    assert motion.unwound(np.array([0.0, 0.0, 0.4, 1.4 + 3.0, 0.0, 0.0]))[3] == pytest.approx(4.4)


def test_taps_all_around_do_not_wind_the_axis_up() -> None:
    world = DiscWorld(None)
    toucher = Toucher(motion_on(world), QUICK, TIP)
    yaws_rad = []
    for turn_rad in np.arange(0.0, 6 * np.pi, 2 * np.pi / 3):
        toucher.tap(GraspFrame(0.0, 0.0, float(turn_rad)))
        yaws_rad.append(abs(float(world.base_q[3])))
    assert max(yaws_rad) <= MOST_rad
