"""An object that tips over while it is carried."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.tilt import tilt_rad
from tests.support.held_objects import BOX, DISC, carried

STILL = Pose2()


def leaning(contacts, degrees, felt=("FF", "MF", "RF", "LF", "TH")):
    """A carry in which the object comes to lean about the x axis."""
    steps = carried(contacts, object_motion=STILL, palm_motion=STILL, felt=felt)
    for n, angle in enumerate(np.linspace(0.0, np.radians(degrees), len(steps))):
        turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
        steps.normals[n] = steps.normals[n] @ turn.T
    return steps


@pytest.mark.parametrize("contacts", [BOX, DISC], ids=["box", "disc"])
def test_an_object_that_leans_is_noticed_and_told(contacts):
    steps = leaning(contacts, 25.0)
    assert np.degrees(tilt_rad(steps)) == pytest.approx(24.0, abs=3.0)
    carry = CarryOdometry({}, "right").carry(steps)
    assert "has it fallen over?" in carry.in_words()
    assert carry.is_remarkable
    assert carry.sigma.translation_m > 0.01


def test_one_that_stands_is_not():
    assert tilt_rad(leaning(BOX, 5.0)) == 0.0


def test_fingertips_that_slide_up_a_round_side_are_no_tilt():
    """All normals rise, on both sides."""
    steps = carried(BOX, object_motion=STILL, palm_motion=STILL)
    steps.normals[..., 2] = np.linspace(0.0, 0.5, len(steps))[:, None]
    assert tilt_rad(steps) == 0.0


def test_nearly_parallel_normals_do_not_show_a_turn_about_themselves():
    """Two degrees of noise are no lean by 45 degrees about the direction of all normals."""
    steps = carried(BOX, object_motion=STILL, palm_motion=STILL)
    steps.normals[..., 0] = np.radians([0.0, 2.0, -2.0, 1.0, 0.0])
    steps.normals[len(steps) // 2 :, :, 2] = np.radians([0.0, 2.0, -2.0, 1.0, 0.0])
    assert tilt_rad(steps) == 0.0


def test_two_fingertips_do_not_tell_it():
    assert tilt_rad(leaning(BOX, 25.0, felt=("MF", "TH"))) == 0.0
