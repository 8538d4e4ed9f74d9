"""Whole results of small fixed forearm calibrations: pose, covariance, offsets, residuals, verdicts and their words."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from gtsam import Pose3

from calibration.forearm.board_problem import BoardProblem
from calibration.forearm.hand_eye import mean_pose, solve_ax_xb, solve_ax_zb
from calibration.forearm.placement import ForearmCalibration
from calibration.forearm.record import manual_record, record_of, transform_of
from calibration.forearm.recordings import ForearmData
from calibration.forearm.stream_problem import StreamProblem
from calibration.forearm.touch_plan import plan_touches
from calibration.forearm.touch_problem import TouchProblem, closed_form
from calibration.forearm.view_plan import ViewSettings, plan_views
from calibration.forearm.wizard import WizardSettings, solve_forearm
from calibration.steps.geometry import Block, KnownGeometry, TableEdges, patches
from calibration.steps.motion_check import MotionNeeds, check_touches, check_views
from calibration.steps.observations import PosePair, Touch, View
from calibration.steps.quality import judge
from calibration.store.admission import Installation
from drivers.core.fingertip import RigidTransform
from drivers.shadow.closing.posture import TipEllipsoid
from drivers.shadow.model.hand_form import HandForm
from tactile_lab.experiments.data.calibration_data import CAMERA, MARKERS, TrueRig, touches_of, views_of
from tests.support.baseline import assert_baseline
from tests.support.plain_values import plain
from tests.support.stream_table import simulated_streams

GEOMETRY = KnownGeometry(
    table=TableEdges(size_m=(1.0, 0.8), centre_m=(0.1, -0.05), thickness_m=0.03, pressed_m=0.25),
    block=Block(
        size_m=(0.1, 0.08, 0.06),
        world_T_block=RigidTransform(translation_m=(0.2, 0.1, 0.03), rpy_rad=(0.0, 0.0, 0.4)),
        sigma_m=3e-4,
    ),
    points_world_m={"a": (0.1, 0.2, 0.0), "b": (-0.2, 0.1, 0.01)},
)
LEFT = HandForm("left")
HERE = Installation("lab", {"hand": "378", "base": "9", "camera": "c", "ft/FF": "1"})
SOLVED = {"rtol": 1e-5, "atol": 1e-12}
"""Of what was iterated for: variances are small numbers, so nearly nothing is allowed beside the share."""

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def touched(form: HandForm, seed: int = 3) -> tuple[Touch, ...]:
    """Touches of every target by two fingers, one of them off by 2 cm, one of unknown force."""
    rng = np.random.default_rng(seed)
    rig = TrueRig.draw(rng)
    touches = touches_of(plan_touches(GEOMETRY, ("FF", "LF"), 2, form), rig, rng)
    touches[5] = replace(touches[5], point_distal_m=touches[5].point_distal_m + np.array([0.0, 0.02, 0.01]))
    told = touches[3]
    touches[3] = Touch(
        told.finger, told.pose, told.point_distal_m, told.normal_distal, told.point_covariance_m2, told.target
    )
    return tuple(touches)


@pytest.fixture(scope="module")
def views() -> tuple[View, ...]:
    """Pictures through a thin plate of glass, one with a displaced corner and one that hides the world marker."""
    rng = np.random.default_rng(4)
    found = views_of(plan_views(ViewSettings(pictures=8)), TrueRig.draw(rng), rng)
    moved = found[2].board_px.copy()
    moved[3] += [6.0, -4.0]
    found[2] = replace(found[2], board_px=moved)
    found[6] = replace(found[6], world_px=None)
    return tuple(found)


@pytest.mark.parametrize("form", [HandForm("right"), LEFT], ids=["right", "left"])
def test_places_to_touch_and_to_show_the_board_at(form: HandForm) -> None:
    mount, tip = Pose3.Expmap(np.array([0.1, -0.2, 0.3, 0.05, 0.1, -0.2])), TipEllipsoid()
    touches = [
        [touch.instruction, touch.joints_rad, touch.base_q(mount, touch.joints_rad, tip, 0.01)]
        for touch in plan_touches(GEOMETRY, ("FF", "MF", "RF"), 5, form)
    ]
    views = [[v.instruction, v.joints_rad, v.base_q(mount)] for v in plan_views(ViewSettings(pictures=6), form)]
    targets = [] if form is LEFT else plain(patches(GEOMETRY))
    assert_baseline(f"calibration/plans_{form.side}", {"touches": touches, "views": views, "targets": targets})


@pytest.mark.parametrize("form", [HandForm("right"), LEFT], ids=["right", "left"])
def test_touches_of_every_target(form: HandForm) -> None:
    touches = touched(form)
    guess = Pose3.Expmap(np.array([0.05, 0.0, -0.05, 0.01, 0.02, 0.0]))
    problem = TouchProblem(touches, guess=guess)
    solution = problem.solve()
    found = {
        "start": plain(closed_form(touches, guess)),
        "solution": plain(solution),
        "residuals": plain(problem.residuals(solution)),
        "from some": plain(problem.solve(range(4, problem.count), solution).world_T_mount),
        "motion": plain(check_touches(touches)),
        "little": plain(check_touches(touches[:4], MotionNeeds(touches=6))),
    }
    assert_baseline(f"calibration/touches_{form.side}", found, **SOLVED)


def test_pictures_of_a_board(views: tuple[View, ...]) -> None:
    markers = MARKERS.model_copy(update={"glass_thickness_m": 0.005, "print_scale": 1.001})
    problem = BoardProblem(views, CAMERA, markers)
    solution = problem.solve()
    quality = judge(problem, solution)
    found = {"solution": plain(solution), "quality": plain(quality), "motion": plain(check_views(views))}
    found["motion of a finger"] = plain(check_views(views[:3], "MF"))
    assert_baseline("calibration/pictures", found, **SOLVED)


def some_pairs() -> tuple[PosePair, ...]:
    """Noisy pairs, a distant and a gross outlier among them."""
    rng = np.random.default_rng(5)
    hand_T_target, mount_T_camera = (Pose3.Expmap(size * rng.standard_normal(6)) for size in (0.1, 0.5))
    pairs = []
    for number in range(10):
        hand = Pose3.Expmap(np.repeat([0.6, 0.15], 3) * rng.standard_normal(6))
        off = Pose3.Expmap(({3: 0.02, 7: 0.5}.get(number, 0.0) + 5e-4) * rng.standard_normal(6))
        pairs.append(PosePair(hand, mount_T_camera.inverse() * hand * hand_T_target * off))
    return tuple(pairs)


def test_pairs_of_poses_and_their_record() -> None:
    pairs = some_pairs()
    poses = [pair.mount_T_hand for pair in pairs], [pair.camera_T_target for pair in pairs]
    result = solve_forearm(ForearmData(pairs=pairs), WizardSettings(needs=MotionNeeds(poses=5)))
    assert_baseline(
        "calibration/pairs",
        {
            "park and martin": plain(solve_ax_xb(*poses)),
            "shah": plain(solve_ax_zb(*poses)),
            "mean": plain(mean_pose(poses[0])),
            "result": plain(result),
            "record": plain(record_of(result, HERE, notes="at noon", now=NOON)) | {"software": {}},
        },
        **SOLVED,
    )


def test_streams_of_poses() -> None:
    streams = simulated_streams(3, 0.3, larger=0.005)
    streams = replace(streams, most_poses=12, most_delay_s=0.5)
    problem = StreamProblem(streams)
    solution = problem.solve()
    found = {"delay": streams.first_delay_s, "used": streams.used_s, "solution": plain(solution)}
    found["residuals"] = plain(problem.residuals(solution))
    found["speeds"] = streams.mount_T_hand.speeds_rad_s(streams.mount_T_hand.grid_s[::200])
    assert_baseline("calibration/streams", found, **SOLVED)


def test_a_stated_pose() -> None:
    stated = transform_of((0.1, 0.2, -0.3), (10.0, -20.0, 30.0))
    record = manual_record(stated, 1e-3, 0.01, HERE, valid_days=30.0, now=NOON)
    plainly = ForearmCalibration(
        world_T_mount=RigidTransform(translation_m=(0.0, 0.0, 0.1)), translation_sigma_m=2e-3, rotation_sigma_rad=0.02
    )
    assert_baseline(
        "calibration/stated_pose",
        {"record": plain(record) | {"software": {}}, "covariance": plainly.covariance()},
        atol=1e-12,
    )
