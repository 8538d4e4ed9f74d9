"""The hand with one finger down: where its fingertip is, and how far all else stays away."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS
from drivers.shadow.closing.closing import MIRROR
from drivers.shadow.closing.finger_down import FINGER, LEANS_rad, finger_down
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINT_LIMITS_rad, joint_vector, palm_T_distal_matrices

HAND = HandShape()
LEANS = pytest.mark.parametrize("lean_rad", LEANS_rad)


@LEANS
def test_the_fingertips_lowest_point_is_the_origin(lean_rad: float) -> None:
    posture = finger_down(lean_rad, HAND)
    angles_rad = {name: a for f in FINGERS for name, a in posture.table.angles_rad(f, 0.0).items()}
    palm = posture.table.grasp_T_palm.matrix()
    distal = (palm @ palm_T_distal_matrices(joint_vector(angles_rad)))[FINGERS.index(FINGER)]
    around = np.random.default_rng(0).normal(size=(20_000, 3))
    surface_m = HAND.semi_axes_m * around / np.linalg.norm(around, axis=1)[:, None] + HAND.centre_distal_m
    tip_m = surface_m @ distal[:3, :3].T + distal[:3, 3]
    assert tip_m[:, 2].min() == pytest.approx(0.0, abs=2e-4)
    np.testing.assert_allclose(tip_m.mean(axis=0), posture.tip_m, atol=3e-4)
    np.testing.assert_allclose(posture.tip_m[:2], 0.0, atol=1e-12)


@LEANS
def test_the_tip_is_ahead_of_its_finger_on_the_side_to_which_it_leans(lean_rad: float) -> None:
    posture = finger_down(lean_rad, HAND)
    own_m, radii_m = posture.balls_m[posture.is_own], posture.radii_m[posture.is_own]
    assert (own_m @ posture.ahead + radii_m).max() < HAND.radius_m + 0.002
    assert np.sign(posture.ahead[0]) == np.sign(lean_rad)


@LEANS
def test_all_else_stays_high_above_the_fingertip(lean_rad: float) -> None:
    posture = finger_down(lean_rad, HAND)
    assert posture.room_m(np.inf) > 0.085
    assert posture.room_m(0.03) >= posture.room_m(np.inf)


@LEANS
def test_joints_are_within_their_limits(lean_rad: float) -> None:
    posture = finger_down(lean_rad, HAND)
    for finger in FINGERS:
        for joint, angle_rad in posture.table.angles_rad(finger, 0.0).items():
            low_rad, high_rad = JOINT_LIMITS_rad[JOINT_INDEX[joint]]
            assert low_rad - 1e-9 <= angle_rad <= high_rad + 1e-9


@LEANS
def test_a_left_hand_is_the_mirror_image(lean_rad: float) -> None:
    right, left = finger_down(lean_rad, HAND), finger_down(lean_rad, HAND.mirrored)
    assert left.table.form.is_left
    np.testing.assert_allclose(left.balls_m, MIRROR * right.balls_m)
    np.testing.assert_array_equal(left.ahead, right.ahead)
    assert left.table.joints(FINGER, 0.0) == right.table.joints(FINGER, 0.0)


def test_a_hand_without_a_little_finger_takes_it_up_too() -> None:
    form = HandForm(driven=tuple(name for name in HAND.form.driven if not name.startswith("LF")))
    posture = finger_down(LEANS_rad[0], HandShape(form=form))
    assert "LF" not in posture.table.fingers
    assert posture.room_m(np.inf) > 0.085
