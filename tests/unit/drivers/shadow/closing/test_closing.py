"""Closing paths: tips on their lines, posture fit for the table, joints the hand can take."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import ConfigurationError
from drivers.core.poses import transform_points
from drivers.shadow.closing.closing import LEANING, PRESHAPES, Closing, TipPath, closing, motor_targets
from drivers.shadow.closing.posture import NODES, HandShape, LEAN_rad, finger_joints
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINT_LIMITS_rad, joint_vector, palm_T_distal

HEIGHTS_m = (0.016, 0.022, 0.033, 0.048)
EVERY_TABLE = [(name, height) for name in PRESHAPES for height in HEIGHTS_m]


def grasp_T_tip(table: Closing, finger: str, u: float) -> Pose3:
    """The fingertip's ellipsoid in the grasp frame, from the hand's own kinematics."""
    joints = joint_vector(table.angles_rad(finger, u))
    return table.grasp_T_palm * palm_T_distal(joints)[finger]


def tip_centre_m(table: Closing, finger: str, u: float) -> Array:
    return transform_points(grasp_T_tip(table, finger, u), np.array([HandShape().centre_distal_m]))[0]


@pytest.mark.parametrize(("name", "height_m"), EVERY_TABLE)
def test_tip_centres_follow_their_lines(name: str, height_m: float) -> None:
    table = closing(name, height_m)
    for finger in FINGERS:
        path = table.path(finger)
        for u in np.linspace(*path.valid, 31):
            error_m = np.abs(tip_centre_m(table, finger, u) - path.centre_m(u))
            assert error_m[0] < 0.005
            assert error_m[1] < 0.009
            assert error_m[2] < (0.003 if 0.25 < u < 0.65 else 0.020)


@pytest.mark.parametrize(("name", "height_m"), EVERY_TABLE)
def test_most_of_every_line_can_be_used(name: str, height_m: float) -> None:
    for finger in FINGERS:
        low, high = closing(name, height_m).path(finger).valid
        assert low <= 0.2
        assert high >= 0.9


@pytest.mark.parametrize(("name", "height_m"), EVERY_TABLE)
def test_tips_stay_above_the_table(name: str, height_m: float) -> None:
    table = closing(name, height_m)
    semi_axes_m = np.array(HandShape().semi_axes_m)
    for finger in FINGERS:
        for u in np.linspace(*table.path(finger).valid, 15):
            tip = grasp_T_tip(table, finger, u)
            reach_m = np.linalg.norm(tip.rotation().matrix()[2] * semi_axes_m)
            assert tip_centre_m(table, finger, u)[2] - reach_m > 0.002


@pytest.mark.parametrize(("name", "height_m"), EVERY_TABLE)
def test_joints_keep_their_limits(name: str, height_m: float) -> None:
    table = closing(name, height_m)
    for finger in FINGERS:
        low, high = JOINT_LIMITS_rad[[JOINT_INDEX[joint] for joint in finger_joints(finger)]].T
        assert np.all(table.tables[finger] >= low)
        assert np.all(table.tables[finger] <= high)


@pytest.mark.parametrize("name", PRESHAPES)
def test_tips_lean_inward_and_the_palm_keeps_its_height(name: str) -> None:
    table = closing(name, 0.022)
    assert table.grasp_T_palm.z() > 0.100
    for finger in FINGERS:
        path = table.path(finger)
        axis = grasp_T_tip(table, finger, 0.5 * sum(path.valid)).rotation().matrix()[:, 2]
        assert axis[2] < -0.6
        assert 0.2 * LEAN_rad < np.arcsin(axis @ path.direction) < 2.5 * LEAN_rad


def test_posture_is_the_one_of_the_feasibility_study() -> None:
    """Palm about (-77, -12, 127) mm and 31 deg nose-down for tips at 22 mm."""
    palm = closing("pinch", 0.022).grasp_T_palm
    np.testing.assert_allclose(palm.translation() * 1e3, [-77, -12, 127], atol=3)
    fingers_direction = palm.rotation().matrix()[:, 2]
    assert np.degrees(np.arcsin(-fingers_direction[2])) == pytest.approx(31, abs=3)


def test_neighbouring_postures_are_close() -> None:
    for name in PRESHAPES:
        for finger in FINGERS:
            path = closing(name, 0.022).path(finger)
            first, last = (round(u * (NODES - 1)) for u in path.valid)
            steps_rad = np.abs(np.diff(closing(name, 0.022).tables[finger][first : last + 1], axis=0))
            assert steps_rad.max() < 0.35


def test_only_the_coupled_tendon_is_commanded() -> None:
    table = closing("pinch", 0.022)
    angles = table.angles_rad("MF", 0.4)
    targets = table.joints("MF", 0.4)
    assert set(targets) == {"MFJ4", "MFJ3", "MFJ0"}
    assert targets["MFJ0"] == pytest.approx(angles["MFJ1"] + angles["MFJ2"])
    assert set(table.joints("TH", 0.4)) == {f"THJ{number}" for number in (1, 2, 3, 4, 5)}
    assert set(table.joints("LF", 0.4)) == {"LFJ5", "LFJ4", "LFJ3", "LFJ0"}


def test_motor_targets_add_the_distal_pair() -> None:
    assert motor_targets({"FFJ1": 0.25, "FFJ2": 0.5, "FFJ3": 1.0}) == {"FFJ0": 0.75, "FFJ3": 1.0}


def test_distal_joint_bends_less_than_the_middle_one() -> None:
    """The passive split of the tendon keeps J1 below J2; the table asks for about 0.6 of it."""
    for finger in ("FF", "MF", "RF", "LF"):
        angles = closing("pinch", 0.022).angles_rad(finger, 0.5)
        assert angles[f"{finger}J1"] <= angles[f"{finger}J2"] + 0.05


def test_progress_outside_the_range_is_clipped() -> None:
    table = closing("radial", 0.022)
    low, high = table.path("FF").valid
    assert table.joints("FF", -1.0) == table.joints("FF", low)
    assert table.joints("FF", 2.0) == table.joints("FF", high)


def test_same_question_same_table() -> None:
    first = closing("pinch", 0.0221)
    closing.cache_clear()
    second = closing("pinch", 0.0221)
    assert first is not second
    for finger in FINGERS:
        np.testing.assert_array_equal(first.tables[finger], second.tables[finger])


def test_a_longer_tip_raises_the_palm() -> None:
    long_tip = HandShape(semi_axes_m=(0.0095, 0.0095, 0.016), centre_distal_m=(0.0, 0.0, 0.025))
    assert (
        np.linalg.norm(
            closing("pinch", 0.022, long_tip).grasp_T_palm.translation()
            - closing("pinch", 0.022).grasp_T_palm.translation()
        )
        > 1e-4
    )


def test_path_geometry() -> None:
    path = TipPath(np.array([0.08, 0.0, 0.02]), np.array([-0.02, 0.0, 0.02]), (0.0, 1.0))
    assert path.length_m == pytest.approx(0.1)
    np.testing.assert_allclose(path.direction, [-1, 0, 0])
    np.testing.assert_allclose(path.centre_m(0.25), [0.055, 0.0, 0.02])


def test_unknown_closing_is_refused_by_name() -> None:
    with pytest.raises(ConfigurationError, match="pinch, pinch-from-left"):
        closing("scoop", 0.022)


@pytest.mark.parametrize("height_m", [0.0, 0.011, 0.2, float("nan")])
def test_impossible_height_is_refused(height_m: float) -> None:
    with pytest.raises(ConfigurationError, match="height"):
        closing("pinch", height_m)


@pytest.mark.parametrize("height_m", [0.018, 0.034])
def test_a_hand_that_leans_has_its_fingers_one_above_the_other_and_clear_of_the_table(height_m: float) -> None:
    table = closing("aside", height_m)
    starts_m = [table.path(finger).start_m[2] for finger in ("FF", "MF", "RF", "LF")]
    assert starts_m[0] == pytest.approx(height_m)
    assert np.all(np.diff(starts_m) > 0.008)
    assert starts_m[0] < table.path("TH").start_m[2] < starts_m[2]
    semi_axes_m = np.array(HandShape().semi_axes_m)
    for finger in FINGERS:
        for u in np.linspace(*table.path(finger).valid, 15):
            tip = grasp_T_tip(table, finger, u)
            assert np.linalg.norm(tip_centre_m(table, finger, u) - table.path(finger).centre_m(u)) < 0.020
            reach_m = np.linalg.norm(tip.rotation().matrix()[2] * semi_axes_m)
            assert tip_centre_m(table, finger, u)[2] - reach_m > 0.002


def test_a_hand_that_leans_is_the_upright_one_turned() -> None:
    table, upright = closing("aside", 0.018), closing(LEANING["aside"].upright, LEANING["aside"].height_m)
    turn = table.grasp_T_palm * upright.grasp_T_palm.inverse()
    assert np.allclose(turn.rotation().xyz(), [-LEANING["aside"].lean_rad, 0.0, 0.0])
    for finger in FINGERS:
        np.testing.assert_array_equal(table.tables[finger], upright.tables[finger])
