"""Errors of carries from what was felt and what was true."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import StepSigma
from sessions.perception.carrying.carry import Carry
from tactile_lab.experiments.data.spoilt_samples import SPOILT
from tactile_lab.experiments.runs.carried_objects import PALM, WatchedCarry, figures

START, MOVED = Pose2(0.02, 0.01, 0.3), Pose2(0.03, -0.01, 0.4)
SIGMA = StepSigma(0.001, float(np.radians(0.5)))
STATED = StepSigma(0.002, float(np.radians(0.5)))


def carry(motion):
    return Carry(motion, SIGMA, 0.0, 0.0, 0.0, 0.0, 0.0, ())


def watched(later):
    """Felt 1 mm too far along x; the palm 4 mm and 2 degrees too far."""
    right = MOVED * START.inverse()
    by = dict.fromkeys(SPOILT, carry(Pose2(0.001, 0.0, 0.0) * right))
    there = MOVED * Pose2(0.0, 0.0, np.radians(2.0))
    return WatchedCarry(
        {**by, PALM: carry(Pose2(0.0, 0.004, 0.0) * there * START.inverse())}, START, MOVED, later, STATED
    )


def test_errors_are_those_of_the_objects_place_and_angle():
    found = figures([watched(MOVED)])
    assert found["as_measured_carry_mm"] == pytest.approx([1.0])
    assert found["as_measured_carry_deg"] == pytest.approx([0.0], abs=1e-9)
    assert found["palm_carry_mm"] == pytest.approx([4.0])
    assert found["palm_carry_deg"] == pytest.approx([2.0])


def test_the_next_closings_push_counts_in_the_step_alone():
    """Two millimetres farther along x: one beyond what was felt."""
    found = figures([watched(Pose2(0.002, 0.0, 0.0) * MOVED)])
    assert found["as_measured_carry_mm"] == pytest.approx([1.0])
    assert found["as_measured_step_axis_mm"] == pytest.approx([-1.0, 0.0])
    assert found["stated_z_mm"] == pytest.approx([-0.5, 0.0])
    assert found["stated_z_deg"] == pytest.approx([0.0], abs=1e-9)


def test_the_last_carry_has_no_step():
    found = figures([watched(None)])
    assert found["as_measured_step_mm"] == []
    assert len(found["as_measured_carry_mm"]) == 1
