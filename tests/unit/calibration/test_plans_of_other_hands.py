"""Calibrations of left and Lite hands: mirrored plans, and only the joints that the hand has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3

from calibration.fingertip.plan import PlannedFree, plan_wrenches
from calibration.forearm.board_problem import BoardProblem
from calibration.forearm.placement import ForearmCalibration
from calibration.forearm.record import check_hand
from calibration.forearm.recordings import ForearmData, load_data, save_data
from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.touch_problem import TouchProblem
from calibration.forearm.view_plan import ViewSettings, plan_views
from calibration.hand.block_plan import plan_block
from calibration.hand.block_problem import BlockSettings, solve_block
from calibration.steps.geometry import Block, KnownGeometry, TableEdges
from calibration.steps.hand_chain import joints_of, mount_T_link
from calibration.steps.observations import HandPose
from calibration.steps.quality import region_holds
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import RigidTransform
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINT_INDEX
from drivers.shadow.model.motors import DRIVEN_JOINTS
from tactile_lab.experiments.data import calibration_data
from tactile_lab.experiments.data.calibration_data import CAMERA, MARKERS, TrueRig, touches_of, views_of

TABLE = KnownGeometry(table=TableEdges(size_m=(1.0, 1.0), thickness_m=0.02, pressed_m=0.3))
BLOCK = Block(size_m=(0.12, 0.06, 0.06), world_T_block=RigidTransform(translation_m=(0.0, 0.0, 0.03)))
LEFT = RIGHT_HAND.mirrored
LITE = HandForm(driven=tuple(name for name in DRIVEN_JOINTS if name[:2] not in ("LF", "WR") and name != "THJ3"))
LEFT_LITE = LITE.mirrored
FORMS = [pytest.param(LEFT, id="left"), pytest.param(LITE, id="Lite"), pytest.param(LEFT_LITE, id="left Lite")]
_FRAME = np.diag([-1.0, 1.0, 1.0])


def true_rig(seed: int) -> tuple[TrueRig, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return TrueRig.draw(rng), rng


def mirror_across(away: np.ndarray) -> np.ndarray:
    """The mirror image in the vertical plane that contains a horizontal direction, shape (3, 3)."""
    normal = np.array([-away[1], away[0], 0.0]) / np.hypot(away[0], away[1])
    return np.eye(3) - 2.0 * np.outer(normal, normal)


def test_a_left_hands_touches_are_mirror_images_of_a_right_hands() -> None:
    """In the vertical plane of the face's normal: of a table's edge, and of the sides of a block."""
    plans = zip(plan_touches(TABLE), plan_touches(TABLE, form=LEFT), strict=True)
    blocks = zip(plan_block(BLOCK), plan_block(BLOCK, form=LEFT), strict=True)
    sides = [pair for pair in (*plans, *blocks) if abs(pair[0].patch.normal_world[2]) < 0.5]
    for right, left in sides:
        mirror = mirror_across(right.patch.normal_world)
        np.testing.assert_allclose(left.world_R_distal, mirror @ right.world_R_distal @ _FRAME, atol=1e-9)
    assert len(sides) > 30


def test_a_left_fingertip_is_turned_and_pressed_in_the_mirror() -> None:
    """In the plane y = 0: free in the air, and leaning on the table."""
    mirror = np.diag([1.0, -1.0, 1.0])
    for right, left in zip(plan_wrenches("FF"), plan_wrenches("FF", form=LEFT), strict=True):
        if isinstance(right, PlannedFree):
            assert isinstance(left, PlannedFree)
            assert (left.pitch_rad, left.roll_rad) == (right.pitch_rad, -right.roll_rad)
        else:
            assert not isinstance(left, PlannedFree)
            np.testing.assert_allclose(left.world_R_distal, mirror @ right.world_R_distal @ _FRAME, atol=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_a_fingertip_comes_to_where_the_plan_has_it(form: HandForm) -> None:
    tip = TipEllipsoid()
    for planned in (*plan_touches(TABLE, per_patch=2, form=form), *plan_block(BLOCK, form=form)[::5]):
        joints = planned.joints_rad
        assert not joints[[JOINT_INDEX[name] for name in JOINT_INDEX if name not in form.joints]].any()
        pose = HandPose(planned.base_q(Pose3(), joints, tip), joints, form)
        np.testing.assert_allclose(mount_T_link(pose, planned.finger), planned.world_T_distal(tip).matrix(), atol=1e-9)


def test_only_joints_that_a_hand_has_are_unknowns() -> None:
    assert joints_of(["FF"]) == ("WRJ2", "WRJ1", "FFJ4", "FFJ3", "FFJ2", "FFJ1")
    assert joints_of(["FF"], LITE) == ("FFJ4", "FFJ3", "FFJ2", "FFJ1")
    assert joints_of(["palm"], LITE) == ()
    assert "THJ3" not in joints_of(["TH"], LITE)


@pytest.mark.parametrize("form", FORMS)
def test_touches_find_the_mount_of_other_hands(form: HandForm) -> None:
    rig, rng = true_rig(1)
    touches = touches_of(plan_touches(TABLE, ("FF", "MF"), 4, form), rig, rng)
    solution = TouchProblem(touches).solve()
    assert region_holds(solution, rig.world_T_mount)
    away = solution.world_T_mount.between(rig.world_T_mount)
    assert np.linalg.norm(away.translation()) < 1.5e-3
    assert set(solution.offsets) <= set(form.joints)


@pytest.mark.parametrize("form", FORMS)
def test_pictures_find_the_mount_of_other_hands(form: HandForm) -> None:
    rig, rng = true_rig(2)
    views = views_of(plan_views(ViewSettings(pictures=12), form), rig, rng)
    solution = BoardProblem(views, CAMERA, MARKERS).solve()
    assert region_holds(solution, rig.world_T_mount)
    assert np.linalg.norm(solution.world_T_mount.between(rig.world_T_mount).translation()) < 2.5e-3


def test_a_block_tells_a_left_lite_hands_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration_data, "CONTACT_SIGMA_m", 2e-4)
    rig, rng = true_rig(3)
    touches = touches_of(plan_block(BLOCK, form=LEFT_LITE), rig, rng)
    forearm = ForearmCalibration.of(rig.world_T_mount, 1e-8 * np.eye(6))
    found = solve_block(touches, forearm, BlockSettings())
    assert found.passed, [str(judgement) for judgement in found.judgements]
    told = {joint: offset for joint, offset in found.offsets.items() if offset.observable}
    assert {"FFJ3", "FFJ4", "MFJ3", "MFJ4"} <= set(told)
    for joint, offset in told.items():
        assert abs(offset.offset_rad - rig.bias_rad[JOINT_INDEX[joint]]) < 4.0 * offset.sigma_rad


def test_a_recording_keeps_its_hand_and_is_refused_on_another(tmp_path: Path) -> None:
    rig, rng = true_rig(4)
    file = tmp_path / "touches.json"
    save_data(file, ForearmData("lab", form=LEFT_LITE, touches=tuple(touches_of(plan_touches(TABLE), rig, rng))))
    data = load_data(file)
    assert data.touches[0].pose.form == data.form == LEFT_LITE
    check_hand(data, LEFT_LITE, str(file))
    with pytest.raises(ConfigurationError, match="with a left hand with FF, MF, RF, TH, but the rig has a right"):
        check_hand(data, LITE, str(file))
    file.write_text(file.read_text().replace('"FFJ0"', '"FFJ7"'))
    with pytest.raises(ConfigurationError, match="no motor drives FFJ7"):
        load_data(file)
