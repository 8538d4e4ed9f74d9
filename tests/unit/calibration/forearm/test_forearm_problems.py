from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose3
from pydantic import ValidationError

from calibration.forearm.board_problem import BoardProblem
from calibration.forearm.record import check_origin
from calibration.forearm.recordings import ForearmData, load_data, save_data
from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.touch_problem import TouchProblem
from calibration.forearm.view_plan import ViewSettings, plan_views
from calibration.forearm.wizard import ForearmWizard, solve_forearm
from calibration.steps.geometry import Block, KnownGeometry, TableEdges, patches
from calibration.steps.motion_check import check_touches
from calibration.steps.quality import QualityLimits, judge, region_holds
from calibration.store.admission import Installation
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.fingertip import RigidTransform
from tactile_lab.experiments.data.calibration_data import CAMERA, MARKERS, TrueRig, touches_of, views_of

TABLE = KnownGeometry(table=TableEdges(size_m=(1.0, 1.0), thickness_m=0.02, pressed_m=0.3))
PLAN = plan_touches(TABLE, ("FF", "MF"), 4)


def rig(seed: int) -> tuple[TrueRig, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return TrueRig.draw(rng), rng


@pytest.fixture(scope="module")
def touches():
    return tuple(touches_of(PLAN, *rig(1)))


@pytest.fixture(scope="module")
def views():
    return tuple(views_of(plan_views(ViewSettings(pictures=12)), *rig(1)))


def off(solution, truth: Pose3) -> tuple[float, float]:
    """Error in mm and deg."""
    away = solution.world_T_mount.between(truth)
    return 1e3 * float(np.linalg.norm(away.translation())), float(np.degrees(np.linalg.norm(Pose3.Logmap(away)[:3])))


def test_touches_find_the_mount_and_their_region_holds_it(touches):
    solution = TouchProblem(touches).solve()
    truth = rig(1)[0].world_T_mount
    assert off(solution, truth)[0] < 1.5
    assert off(solution, truth)[1] < 0.6
    assert region_holds(solution, truth)
    assert solution.offsets["WRJ2"].observable
    assert not solution.offsets["FFJ1"].observable


def test_pictures_find_the_mount_and_the_boards_place_on_the_hand(views):
    solution = BoardProblem(views, CAMERA, MARKERS).solve()
    truth = rig(1)[0].world_T_mount
    assert off(solution, truth)[0] < 2.5
    assert off(solution, truth)[1] < 0.6
    assert region_holds(solution, truth)
    assert {"palm_T_board", "world_T_camera"} == set(solution.others)


def test_a_touch_that_is_far_off_is_an_outlier_and_hardly_counts(touches):
    spoilt = list(touches)
    spoilt[7] = replace(spoilt[7], point_distal_m=spoilt[7].point_distal_m + np.array([0.03, 0.03, 0.0]))
    solution = TouchProblem(spoilt).solve()
    assert 7 in solution.outliers
    assert off(solution, rig(1)[0].world_T_mount)[0] < 2.0


def test_quality_has_residuals_held_out_ones_repeats_and_a_verdict(touches):
    problem = TouchProblem(touches)
    found = judge(problem, problem.solve())
    assert len(found.residuals) == len(touches)
    assert found.held_out_m >= 0.9 * found.residual_m
    assert 0.0 < found.repeat_m < 0.002
    assert found.region_m[0] < found.region_m[2]
    assert found.passed
    strict = judge(problem, problem.solve(), QualityLimits(region_mm=0.01))
    assert not strict.passed
    assert any("95 % region" in str(judgement) for judgement in strict.judgements if not judgement.ok)
    regions = {judged.unit: judged.value for judged in found.judgements if judged.name == "95 % region"}
    assert regions == {"mm": 1e3 * max(found.region_m), "deg": np.degrees(max(found.region_rad))}


def test_touches_of_the_top_alone_are_refused_with_the_direction(touches):
    top = tuple(touch for touch in touches if touch.target.name == "table top") * 4
    with pytest.raises(ConfigurationError, match="too few touches determine the position along"):
        solve_forearm(ForearmData(touches=top))


def test_touches_without_turning_the_hand_are_refused(touches):
    still = [replace(touch, pose=replace(touches[0].pose)) for touch in touches]
    assert any("turns of the hand" in text for text in check_touches(still).missing)


def test_no_touch_at_all_is_told_too():
    assert "touches 0 of 12 needed" in check_touches([]).missing[0]


def test_a_world_marker_that_was_never_seen_is_named(views):
    blind = [replace(view, world_px=None) for view in views]
    with pytest.raises(ConfigurationError, match="the world marker is not visible in any picture"):
        BoardProblem(blind, CAMERA, MARKERS)


def test_a_bumped_world_marker_is_named_with_the_picture(views):
    bumped = list(views)
    bumped[4] = replace(bumped[4], world_px=bumped[4].world_px + 5.0)
    with pytest.raises(ConfigurationError, match=r"was moved: \d+\.\d px off in picture 5"):
        BoardProblem(bumped, CAMERA, MARKERS)


@pytest.mark.parametrize("kind", ["touches", "views"])
def test_recorded_data_come_back_as_they_were(tmp_path, touches, views, kind):
    data = ForearmData(rig="lab", devices={"hand": "378"}, guess=Pose3.Expmap(np.full(6, 0.1)))
    data = (
        replace(data, touches=touches)
        if kind == "touches"
        else replace(data, views=views, camera=CAMERA, markers=MARKERS)
    )
    save_data(tmp_path / "data.json", data)
    back = load_data(tmp_path / "data.json")
    assert back.guess.equals(data.guess, 1e-12)
    first, again = getattr(data, kind)[3], getattr(back, kind)[3]
    np.testing.assert_array_equal(first.pose.joints_rad, again.pose.joints_rad)
    assert [path.name for path in tmp_path.iterdir()] == ["data.json"]


def test_data_of_another_rig_or_device_are_refused():
    data = ForearmData(rig="lab", devices={"hand": "378"})
    check_origin(data, Installation("lab", {"hand": "378"}), "data.json")
    with pytest.raises(ConfigurationError, match=r"data\.json: was recorded on rig lab, not on sim"):
        check_origin(data, Installation("sim"), "data.json")
    with pytest.raises(ConfigurationError, match="was recorded with hand 378, not 554"):
        check_origin(data, Installation("lab", {"hand": "554"}), "data.json")


def test_a_block_is_pressed_on_all_faces_but_its_underside():
    block = Block(size_m=(0.2, 0.1, 0.06), world_T_block=RigidTransform(translation_m=(0.0, 0.0, 0.03)))
    names = [patch.target.name for patch in patches(KnownGeometry(block=block))]
    assert names == ["table top", "block +x", "block -x", "block +y", "block -y", "block +z"]


def test_a_top_alone_is_no_geometry():
    with pytest.raises(ValidationError, match="a table top alone does not determine"):
        KnownGeometry()


class Pretended:
    """A measurer that gives simulated touches, and fails where told to."""

    def __init__(self, touches, failing=()) -> None:
        self._touches, self._failing = list(touches), set(failing)

    def measure(self, planned):
        index = next(i for i, other in enumerate(PLAN) if other is planned)
        if index in self._failing:
            raise DeviceError("met nothing", where="touch")
        return self._touches[index]


def test_the_wizard_measures_takes_back_and_measures_again(touches):
    wizard = ForearmWizard("touch", PLAN, ForearmData(rig="lab"))
    steps, measurer = wizard.steps(), Pretended(touches, failing=[2])
    assert steps[0].instruction.startswith("FF presses table top at")
    wizard.measure(steps[0], measurer)
    wizard.measure(steps[1], measurer)
    wizard.measure(steps[1], measurer)
    with pytest.raises(DeviceError):
        wizard.measure(steps[2], measurer)
    assert len(wizard.measured.touches) == 2
    assert wizard.undo() == 2
    assert len(wizard.measured.touches) == 1
    assert not wizard.motion().ok
    with pytest.raises(ConfigurationError, match="the motion is not enough"):
        wizard.solve()
    assert wizard.undo() == 1
    assert wizard.undo() is None
