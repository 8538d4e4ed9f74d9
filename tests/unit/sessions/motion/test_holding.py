"""How hard an object is held, by what was measured of it."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import Contact
from sessions.motion.holding import HoldingForces, HoldingSettings
from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.forecast import IntendedCarry
from sessions.perception.carrying.friction_balance import MeasuredFriction
from tests.support.held_objects import BOX

SETTINGS, USUAL_N = HoldingSettings(), 0.8


def balanced(force_N):
    return {**dict.fromkeys(("FF", "MF", "RF", "LF"), force_N), "TH": 4 * force_N}


def chosen(table_N, sigma_N=0.0, pressed_N=20.0):
    odometry = CarryOdometry({}, "right")
    odometry.measured = MeasuredFriction(table_N, sigma_N, tips_at_least=0.8)
    contacts = [
        Contact(finger, np.array([*point, 0.03]), np.array([*normal, 0.0]), np.zeros((3, 3)), 0.0, 1.0)
        for finger, (point, normal) in BOX.items()
    ]
    intended = IntendedCarry.of(contacts, Pose2(), Pose2(0.02, 0.0, 0.5), 0.8, 0.02)
    return HoldingForces(balanced, SETTINGS, USUAL_N, pressed_N).choose(intended, odometry)


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
