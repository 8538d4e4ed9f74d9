"""Objects that the hand lifts move with the fingertips in all six unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import FINGERS
from sessions.perception.carrying.carry import Carry, CarryOdometry
from sessions.perception.carrying.lifted import dropped_m, raised
from sessions.perception.carrying.tip_steps import TipSteps
from tests.support.held_objects import BOX, DISC, carried

MOTION, COUNT = Pose2(0.006, -0.003, 0.12), 120
UP_m = 0.015


def lifted(contacts: dict[str, tuple[tuple[float, float], tuple[float, float]]], lean_rad: float = 0.0) -> TipSteps:
    """Up, aside and down again; the object sticks to the fingertips, and leans about the thumb's normal meanwhile."""
    steps = carried(contacts, object_motion=MOTION, palm_motion=MOTION, count=COUNT)
    height_m = UP_m * np.interp(np.arange(COUNT + 1), [0, 40, 80, COUNT], [0.0, 1.0, 1.0, 0.0])
    frames, moves_m = steps.world_T_palm.copy(), steps.moves_m.copy()
    frames[:, 2, 3] += height_m
    moves_m[..., 2] += np.diff(height_m)[:, None]
    turns = np.diff(lean_rad * height_m / UP_m)[:, None]
    moves_m[..., 2] -= turns * (steps.points_m[..., 0] - steps.points_m[..., 0].mean(axis=1, keepdims=True))
    return replace(steps, world_T_palm=frames, moves_m=moves_m)


def carry(steps: TipSteps) -> Carry:
    return CarryOdometry({}, "right").carry(steps)


@pytest.mark.parametrize("contacts", [BOX, DISC], ids=["box", "disc"])
@pytest.mark.parametrize("lean_rad", [0.0, 0.1])
def test_an_object_that_is_lifted_goes_with_the_fingertips(contacts, lean_rad: float) -> None:
    found = carry(lifted(contacts, lean_rad)).motion
    assert found.x() == pytest.approx(MOTION.x(), abs=0.0006)
    assert found.y() == pytest.approx(MOTION.y(), abs=0.0006)
    assert found.theta() == pytest.approx(MOTION.theta(), abs=0.008)


def test_only_the_part_above_the_table_counts_as_lifted() -> None:
    up = raised(lifted(BOX))
    assert not up[0]
    assert not up[-1]
    assert up[10:-10].all()
    assert not raised(carried(BOX, object_motion=MOTION, palm_motion=MOTION)).any()


def test_a_hand_that_rises_with_one_finger_lifts_nothing() -> None:
    steps = lifted(BOX)
    forces_N = steps.forces_N.copy()
    forces_N[:, [FINGERS.index(finger) for finger in FINGERS if finger != "TH"]] = 0.0
    assert not raised(replace(steps, forces_N=forces_N)).any()


def lost(steps: TipSteps, at: int) -> TipSteps:
    """No fingertip feels the object from this step on."""
    return replace(steps, forces_N=np.where(np.arange(len(steps))[:, None] < at, steps.forces_N, 0.0))


def test_an_object_that_is_lost_up_there_was_dropped_and_may_lie_anywhere_near() -> None:
    held, dropped = carry(lifted(BOX)), carry(lost(lifted(BOX), COUNT // 2))
    assert dropped.dropped_m == pytest.approx(UP_m)
    assert "dropped from 15 mm" in dropped.in_words()
    assert dropped.is_remarkable
    assert dropped.sigma.translation_m > max(UP_m / 3, held.sigma.translation_m)


def test_what_is_held_until_it_stands_and_what_is_lost_on_the_table_is_not_dropped() -> None:
    assert dropped_m(lifted(BOX)) == 0.0
    assert dropped_m(lost(carried(BOX, object_motion=MOTION, palm_motion=MOTION), 50)) == 0.0
