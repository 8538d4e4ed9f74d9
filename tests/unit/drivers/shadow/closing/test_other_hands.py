"""Closings of a left hand and of hands with fewer joints."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import FINGERS, Array
from drivers.shadow.closing.closing import CLOSINGS, MIRROR, Closing, closing, mirrored_closing
from drivers.shadow.closing.collision_spheres import link_balls
from drivers.shadow.closing.hand_envelope import open_hand
from drivers.shadow.closing.posture import HandShape
from drivers.shadow.closing.tip_motion import motor_rates
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.kinematics import joint_vector, palm_T_distal_matrices
from drivers.shadow.model.motors import DRIVEN_JOINTS

LITE = HandForm(driven=tuple(name for name in DRIVEN_JOINTS if name[:2] not in ("LF", "WR") and name != "THJ3"))
EXTRA_LITE = HandForm(driven=tuple(name for name in LITE.driven if name[:2] != "MF"))
RIGHT, LEFT = HandShape(), HandShape(form=HandForm("left"))


def tip_centres_m(table: Closing, u: float) -> Array:
    """Where the kinematics put the fingertips' centres at one progress, grasp frame, shape (fingers, 3)."""
    angles = {name: angle for finger in table.fingers for name, angle in table.angles_rad(finger, u).items()}
    frames = table.grasp_T_palm.matrix() @ palm_T_distal_matrices(joint_vector(angles), table.form.side)
    rows = [FINGERS.index(finger) for finger in table.fingers]
    return np.asarray((frames[rows] @ np.append(RIGHT.centre_distal_m, 1.0))[:, :3])


@pytest.mark.parametrize("name", sorted(CLOSINGS))
def test_a_left_hand_closes_as_the_mirror_image_of_a_right_one(name: str) -> None:
    left, right = closing(name, 0.034, LEFT), closing(mirrored_closing(name), 0.034, RIGHT)
    assert (left.name, left.form.side, left.fingers) == (name, "left", FINGERS)
    np.testing.assert_allclose(left.approach, MIRROR * right.approach)
    assert np.linalg.det(left.grasp_T_palm.rotation().matrix()) == pytest.approx(1.0)
    for u in (0.2, 0.7):
        np.testing.assert_allclose(tip_centres_m(left, u), tip_centres_m(right, u) * MIRROR, atol=1e-12)
    np.testing.assert_allclose(open_hand(name, 0.034, LEFT).centres_m[:, 1].mean() * -1.0, mean_y(name), atol=1e-12)
    balls = link_balls(name, 0.034, LEFT).centres_m
    np.testing.assert_allclose(balls, link_balls(mirrored_closing(name), 0.034, RIGHT).centres_m * MIRROR)


def mean_y(name: str) -> float:
    return float(open_hand(mirrored_closing(name), 0.034, RIGHT).centres_m[:, 1].mean())


def test_from_its_left_a_left_hand_comes_with_the_first_finger_up() -> None:
    left = closing("pinch-from-left", 0.05, LEFT)
    assert left.approach == (0.0, -1.0, 0.0)
    assert left.path("FF").start_m[2] > left.path("LF").start_m[2]


@pytest.mark.parametrize("form", [LITE, EXTRA_LITE, LITE.mirrored], ids=["lite", "extra-lite", "left lite"])
@pytest.mark.parametrize("name", ["pinch", "radial"])
def test_hands_with_fewer_joints_keep_their_fingertips_on_the_lines(name: str, form: HandForm) -> None:
    table = closing(name, 0.034, HandShape(form=form))
    assert table.fingers == form.fingers
    assert set(table.tables) == set(form.fingers)
    moved = {motor for finger in table.fingers for motor in table.joints(finger, 0.5)}
    assert moved == set(form.driven)
    for u in (0.15, 0.5, 0.7):
        wanted = np.array([table.path(finger).centre_m(u) for finger in table.fingers])
        assert np.abs((tip_centres_m(table, u) - wanted)[:, :2]).max() < 0.009
    low, high = np.array([table.path(finger).valid for finger in table.fingers]).T
    assert low.max() <= 0.2
    assert high.min() >= 0.7
    balls = link_balls(name, 0.034, HandShape(form=form))
    assert balls.usable.shape[1] == len(form.fingers)


def test_small_moves_of_a_fingertip_are_those_of_the_hands_own_side() -> None:
    aside = np.array([0.0, 1.0, 0.0])
    progress = dict.fromkeys(FINGERS, 0.5)
    left = motor_rates(closing("pinch", 0.034, LEFT), progress, -aside, LEFT)
    right = motor_rates(closing("pinch", 0.034, RIGHT), progress, aside, RIGHT)
    for finger, rates in right.items():
        assert left[finger] == pytest.approx(rates)
