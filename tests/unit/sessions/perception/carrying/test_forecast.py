"""What is foretold of a carry: slip by weight, friction and force, and objects that only the fingers keep upright."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import Contact
from sessions.perception.carrying.forecast import IntendedCarry
from sessions.perception.carrying.friction_balance import Friction, MeasuredFriction
from tests.support.held_objects import BOX

HEIGHT_m, NOTHING_KNOWN = 0.03, float("nan")
PRESSED = {"FF": 0.8, "MF": 0.8, "RF": 0.8, "LF": 0.8, "TH": 3.2}


def contacts():
    return [
        Contact(finger, np.array([*point, HEIGHT_m]), np.array([*normal, 0.0]), np.zeros((3, 3)), 0.0, 1.0)
        for finger, (point, normal) in BOX.items()
    ]


def foretold(friction, weight_N=NOTHING_KNOWN, share=1.0, turn_rad=0.4):
    intended = IntendedCarry.of(contacts(), Pose2(), Pose2(0.02, 0.0, turn_rad), 1.0, 0.02)
    return intended.forecast(0.8 * share, {f: share * force for f, force in PRESSED.items()}, friction, weight_N)


def test_a_light_object_is_carried_along():
    light = foretold(Friction(table_N=0.2))
    assert not light.slips
    assert light.slip_m < 0.001
    assert light.in_words() == ""


def test_what_the_fingers_cannot_hold_slips_as_far_as_the_table_holds_it_back():
    """Friction of 8 N against 2 * 0.6 * 3.2 N at the fingertips."""
    heavy = foretold(Friction(table_N=8.0), turn_rad=0.0)
    assert heavy.slip_m == pytest.approx(0.02, abs=0.004)
    assert heavy.slips
    assert "will slip by about" in heavy.in_words()


def test_pressing_harder_lets_it_slip_less_and_slippery_fingertips_more():
    usual = Friction(table_N=2.0)
    assert foretold(usual, share=1.5).slip_m < foretold(usual).slip_m < foretold(replace(usual, tips=0.4)).slip_m


def test_a_narrow_object_on_a_rough_table_is_kept_up_by_the_fingers_alone():
    """Pushed at 30 mm, with a foot of 12 mm radius: over when friction is above 0.4 of the weight."""
    narrow = Friction(table_N=1.5, half_width_m=0.012)
    assert foretold(narrow, weight_N=3.0).leans
    assert "tip over" in foretold(narrow, weight_N=3.0).in_words()
    assert not foretold(replace(narrow, half_width_m=0.03), weight_N=3.0).leans
    assert not foretold(narrow).leans, "nothing is said of an object of unknown weight"


def test_what_was_measured_takes_the_place_of_what_is_usual():
    measured = MeasuredFriction(table_N=0.4, table_sigma_N=0.05, tips_at_least=0.8)
    known = measured.known(Friction())
    assert (known.table_N, known.tips) == (0.4, 0.8)
    assert measured.least_table_N == pytest.approx(0.3)
    assert measured.most_table_N == pytest.approx(0.5)
    assert MeasuredFriction().known(Friction()) == Friction()
    assert MeasuredFriction(tips_at_least=0.2).known(Friction()).tips == Friction().tips
