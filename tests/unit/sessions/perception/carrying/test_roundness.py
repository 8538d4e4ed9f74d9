"""What contacts show of an object's roundness, and what that does to the noise of a carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import FINGERS
from sessions.perception.carrying.carry import CarryOdometry
from sessions.perception.carrying.carry_noise import CarryNoise
from sessions.perception.carrying.friction_balance import Balance
from sessions.perception.carrying.roundness import Roundness
from sessions.perception.carrying.tip_steps import TipSteps
from tests.support.held_objects import BOX, DISC, carried

TURN = Pose2(0.0, 0.0, 0.4)


def turned(held: dict[str, tuple[list[float], list[float]]], fingers: int = 5, lean: float = 0.0) -> TipSteps:
    """A carry in which an object turns with the hand, held by so many fingers; its sides lean."""
    steps = carried(held, object_motion=TURN, palm_motion=TURN, count=40)
    forces_N = steps.forces_N.copy()
    forces_N[:, : len(FINGERS) - fingers] = 0.0
    normals = steps.normals * np.sqrt(1 - lean**2) + np.array([0.0, 0.0, lean])
    return replace(steps, forces_N=forces_N, normals=normals)


def roundness(steps: TipSteps) -> Roundness:
    return Roundness.of(steps, Balance.of(steps))


def test_a_disc_is_loose_and_a_box_is_not() -> None:
    assert roundness(turned(DISC)).turns == pytest.approx(1 / 3, rel=0.05)
    assert roundness(turned(BOX)).turns.max() < 0.6 / 3


def test_each_finger_that_holds_a_round_object_makes_its_turn_more_certain() -> None:
    sigmas_rad = [CarryOdometry({}, "right").carry(turned(DISC, count)).sigma.rotation_rad for count in (5, 4, 3)]
    assert sigmas_rad[0] < 0.8 * sigmas_rad[1] < 0.6 * sigmas_rad[2]
    assert sigmas_rad[2] > 0.05 * TURN.theta()


def test_fingertips_that_do_not_hold_leave_the_turn_of_a_slip_unsure() -> None:
    steps = carried(BOX, object_motion=Pose2(), palm_motion=TURN, count=40)
    forces_N = steps.forces_N.copy()
    forces_N[20:, 1] = 0.0
    unsure, sure = CarryOdometry({}, "right"), CarryOdometry({}, "right")
    sure.noise = CarryNoise(missing_rad=0.0)
    missing = replace(steps, forces_N=forces_N)
    added_rad2 = unsure.carry(missing).sigma.rotation_rad ** 2 - sure.carry(missing).sigma.rotation_rad ** 2
    slipped_rad = abs(unsure.carry(missing).slip_rad)
    assert np.sqrt(added_rad2) == pytest.approx(unsure.noise.missing_rad * 0.5 * slipped_rad, rel=0.01)
    assert unsure.carry(steps).sigma == sure.carry(steps).sigma


def test_a_while_in_which_two_fingers_hold_makes_a_turn_as_uncertain_as_they_do() -> None:
    steps = turned(BOX)
    forces_N = steps.forces_N.copy()
    forces_N[20:, 1:4] = 0.0
    lost = roundness(replace(steps, forces_N=forces_N))
    assert lost.turns[:20] == pytest.approx(roundness(steps).turns[:20])
    assert lost.turns[20:] == pytest.approx(lost.turns[20:].mean())
    assert lost.turns[30] > 5 * lost.turns[10]


def test_sides_that_face_down_may_roll_and_such_as_face_up_do_not() -> None:
    up, upright, down = (turned(DISC, lean=lean) for lean in (0.1, 0.0, -0.1))
    assert roundness(down).overhang == pytest.approx(0.1, abs=0.01)
    assert roundness(up).overhang == roundness(upright).overhang == 0.0
    odometry = CarryOdometry({}, "right")
    variances_m2 = [odometry.carry(steps).sigma.translation_m ** 2 for steps in (up, upright, down)]
    assert np.sqrt(variances_m2[2] - variances_m2[1]) == pytest.approx(0.1 * odometry.noise.roll_m, rel=0.1)
    assert variances_m2[0] == pytest.approx(variances_m2[1], rel=0.01)


def test_an_object_that_nobody_holds_is_not_called_round() -> None:
    steps = turned(DISC)
    lost = replace(steps, forces_N=np.zeros_like(steps.forces_N))
    found = roundness(lost)
    assert found.overhang == 0.0
    assert not found.turns.any()


def test_contacts_that_all_give_way_make_the_place_uncertain_by_what_they_would_squeeze_out() -> None:
    wedge = {finger: ((0.0, 0.03 * side), (0.1, 0.995 * side)) for finger, side in (("FF", 1.0), ("TH", -1.0))}
    away = {"FF": np.array([0.0, -0.008, 0.0]), "TH": np.array([0.0, 0.008, 0.0])}
    held = {**BOX, **wedge}
    still, closing = (
        carried(held, object_motion=Pose2(), palm_motion=Pose2(), felt=tuple(wedge), extra_moves=moves, count=8)
        for moves in (None, away)
    )
    odometry = CarryOdometry({}, "right")
    squeezed = odometry.carry(closing)
    assert squeezed.slip_m > 0.02
    assert squeezed.sigma.translation_m > odometry.carry(still).sigma.translation_m + 0.3 * squeezed.slip_m
