"""Plans of touches and pictures: spread over what can be reached, with the hand turned each way."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.forearm.touch_plan import PlannedTouch, STRETCHED_rad, plan_touches, pointing
from calibration.forearm.view_plan import ViewSettings, palm_T_board, plan_views
from calibration.steps.geometry import KnownGeometry, TableEdges, patches
from drivers.core.contacts import Array
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import RIGHT_HAND
from drivers.shadow.model.kinematics import JOINT_INDEX

TABLE = KnownGeometry(table=TableEdges(size_m=(1.0, 1.0), thickness_m=0.02, pressed_m=0.3))
WIDE = ViewSettings(pictures=60)
TIP = TipEllipsoid()


def of_patch(name: str) -> list[PlannedTouch]:
    return [touch for touch in plan_touches(TABLE, ("FF", "MF"), 8) if touch.patch.target.name == name]


def down(touch: PlannedTouch) -> Array:
    """Where the fingertip points, world frame: the distal frame's z."""
    return np.asarray(touch.world_R_distal[:, 2])


def test_each_patch_is_touched_all_along_by_each_finger_in_turn() -> None:
    for patch in patches(TABLE):
        touches = of_patch(patch.target.name)
        assert [touch.finger for touch in touches] == ["FF", "MF"] * 4
        reach, _ = patch.reach_m
        along = [(touch.place_world_m - patch.centre_world_m) @ reach / (reach @ reach) for touch in touches]
        np.testing.assert_allclose(along, np.arange(-0.875, 1.0, 0.25))
    across = [touch.place_world_m[1] / 0.3 for touch in of_patch("table top")]
    assert min(across) < -0.6
    assert max(across) > 0.6
    assert np.abs(np.diff(sorted(across))).max() < 0.5


def test_edges_are_pressed_from_outside_and_the_top_from_above_leaning() -> None:
    for touch in plan_touches(TABLE, ("FF",), 8):
        tilt = np.degrees(np.arccos(-down(touch)[2]))
        assert round(tilt) in (12, 22)
        outward = touch.patch.normal_world
        if touch.patch.target.name != "table top":
            assert down(touch) @ outward == pytest.approx(-np.sin(np.radians(round(tilt))), abs=0.01)
    ways = {round(float(np.degrees(np.arctan2(*down(touch)[1::-1])))) for touch in of_patch("table top")}
    assert len(ways) == 8  # on the top it leans another way each time


def test_the_hand_is_turned_four_ways_about_the_finger_on_every_patch() -> None:
    for patch in patches(TABLE):
        touches = of_patch(patch.target.name)
        turned = [touch.world_R_distal @ touches[0].world_R_distal.T for touch in touches]
        assert len({tuple(turn.round(6).ravel()) for turn in turned}) == 8


@pytest.mark.parametrize("off_m", [0.0, 0.03])
def test_a_tip_touches_its_place_or_waits_before_it(off_m: float) -> None:
    for touch in plan_touches(TABLE, ("FF",), 4):
        outward = touch.patch.normal_world
        pose = touch.world_T_distal(TIP, off_m)
        local = pose.rotation().matrix().T @ outward
        axes = np.array(TIP.semi_axes_m)
        foremost = np.array(TIP.centre_distal_m) - axes**2 * local / np.linalg.norm(axes * local)
        gap = (pose.transformFrom(foremost) - touch.place_world_m) @ outward
        assert gap == pytest.approx(off_m, abs=1e-9)


def test_a_finger_that_points_is_stretched_and_the_others_are_out_of_its_way() -> None:
    angles = pointing("MF")
    assert (angles["MFJ3"], angles["MFJ2"], angles["MFJ1"]) == STRETCHED_rad
    assert all(angles[f"{finger}J3"] > 1.4 for finger in ("FF", "RF", "LF"))
    assert angles["THJ5"] < -0.5
    bent = pointing("MF", (0.5, 0.6, 0.7))
    assert (bent["MFJ3"], bent["MFJ2"], bent["MFJ1"]) == (0.5, 0.6, 0.7)
    assert all(bent[f"{finger}J{joint}"] == 0.0 for finger in ("FF", "RF", "LF") for joint in (1, 2, 3))


def test_pictures_are_spread_over_the_places_tilts_and_turns_that_are_set() -> None:
    views = plan_views(WIDE)
    assert len(views) == 60
    board = palm_T_board(RIGHT_HAND)
    places = np.array([view.world_T_palm.transformFrom(np.array(board.translation_m)) for view in views])
    share = (places - WIDE.centre_m) / WIDE.spread_m
    assert np.abs(share).max() <= 1.0 + 1e-9
    np.testing.assert_allclose(share.mean(axis=0), 0.0, atol=0.08)
    np.testing.assert_allclose(share.std(axis=0), 3**-0.5, atol=0.06)  # evenly, not in the middle
    wrists = np.array([view.joints_rad[[JOINT_INDEX["WRJ1"], JOINT_INDEX["WRJ2"]]] for view in views]) / WIDE.wrist_rad
    np.testing.assert_allclose(wrists[:, 0], -wrists[:, 1])
    assert 0.9 < np.abs(wrists).max() <= 1.0
    downs = np.array([view.world_T_palm.rotation().matrix() for view in plan_views(WIDE)])
    flat = plan_views(WIDE.model_copy(update={"tilt_rad": 0.0}))
    tilts = [
        np.arccos(np.clip((tilted @ level.world_T_palm.rotation().matrix().T)[2, 2], -1, 1))
        for tilted, level in zip(downs, flat, strict=True)
    ]
    assert 0.95 * WIDE.tilt_rad < max(tilts) <= WIDE.tilt_rad + 1e-9
    assert np.mean(np.array(tilts) > WIDE.tilt_rad / 2**0.5) == pytest.approx(0.5, abs=0.06)


def test_pictures_are_planned_the_same_every_time() -> None:
    for one, other in zip(plan_views(WIDE), plan_views(WIDE), strict=True):
        assert one.world_T_palm.equals(other.world_T_palm, 1e-12)
