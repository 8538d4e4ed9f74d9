"""How hard an object is held, by what was measured of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import Contact, Grasp
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.motion.holding import HoldingForces, HoldingSettings
from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.forecast import IntendedCarry
from sessions.perception.carrying.friction_balance import MeasuredFriction
from tests.support.held_objects import BOX
from tests.support.motion_trace import TracedWorld, grasp_cycle

SETTINGS, USUAL_N = HoldingSettings(), 0.8


def balanced(force_N):
    return {**dict.fromkeys(("FF", "MF", "RF", "LF"), force_N), "TH": 4 * force_N}


def known_to_rub(table_N, sigma_N=0.0):
    odometry = CarryOdometry({}, "right")
    odometry.measured = MeasuredFriction(table_N, sigma_N, tips_at_least=0.8)
    return odometry


def contacts():
    return tuple(
        Contact(finger, np.array([*point, 0.03]), np.array([*normal, 0.0]), np.zeros((3, 3)), 0.0, 1.0)
        for finger, (point, normal) in BOX.items()
    )


def chosen(table_N, sigma_N=0.0, pressed_N=20.0):
    intended = IntendedCarry.of(contacts(), Pose2(), Pose2(0.02, 0.0, 0.5), 0.8, 0.02)
    return HoldingForces(balanced, SETTINGS, USUAL_N, pressed_N).choose(intended, known_to_rub(table_N, sigma_N))


def test_light_objects_are_held_gently_and_heavy_ones_firmly():
    forces_N = [chosen(table_N).force_N for table_N in (0.1, 2.0, 4.0, 50.0)]
    assert forces_N[0] == SETTINGS.forces_N[0]
    assert forces_N == sorted(forces_N)
    assert forces_N[-1] == SETTINGS.forces_N[-1]


def test_what_no_allowed_force_holds_is_foretold_to_slip():
    assert chosen(50.0).slips
    assert not chosen(0.1).slips


def test_a_friction_that_is_less_certain_asks_for_more():
    assert chosen(2.0, sigma_N=0.5).force_N > chosen(2.0).force_N


@pytest.mark.parametrize("pressed_N", [4.5, 3.5, 0.5])
def test_more_than_the_usual_force_is_told_only_within_the_share_of_the_limit(pressed_N):
    force_N = chosen(50.0, pressed_N=pressed_N).force_N
    assert force_N == (1.0 if pressed_N == 4.5 else USUAL_N)


def foretold(table_N, turn_rad, shift_m):
    """By a grasp cycle whose fingers are around an object."""
    world = TracedWorld(None)
    world.perception.held = SimpleNamespace(odometry=known_to_rub(table_N))
    cycle, _ = grasp_cycle(world)
    cycle._plan = GraspPlan(GraspFrame(0.0, 0.0, 0.3), "radial", 0.03)
    cycle.fingers = SimpleNamespace(balanced_forces_N=lambda touching, force_N: balanced(force_N))
    forecast = cycle.forecast(Grasp(0, 0, contacts()), turn_rad, np.array([shift_m, 0.0]))
    return cycle, forecast


def test_what_cannot_be_held_stays_behind_by_the_whole_way_of_the_carry_and_no_more():
    _, forecast = foretold(50.0, 0.0, 0.02)
    assert forecast.slip_m == pytest.approx(0.02, abs=0.002)
    _, forecast = foretold(50.0, 0.3, 0.0)
    assert forecast.slip_rad == pytest.approx(0.3, abs=0.03)


def test_a_cycle_holds_with_the_force_that_was_chosen_and_with_the_usual_one_where_nothing_is_known():
    cycle, forecast = foretold(0.1, 0.3, 0.02)
    assert cycle.holding_N == forecast.force_N == SETTINGS.forces_N[0]
    cycle, forecast = foretold(None, 0.3, 0.02)
    assert forecast is None
    assert cycle.holding_N == cycle.settings.squeeze_force_N
