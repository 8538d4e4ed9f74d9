"""Grasps by the fixed rule: sides, closings and heights in turn, bounded steps, and the centre from contacts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.configuration import validate
from drivers.core.contacts import Contact, Grasp
from drivers.core.errors import ConfigurationError
from drivers.shadow.closing.closing import closing
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.heuristic_planner import HeuristicPlanner, PlanSettings, contact_centre
from tactile_lab.autonomy.variance_planner import closing_rays


def rule(**content: Any) -> HeuristicPlanner:
    return HeuristicPlanner(validate(content, PlanSettings, where="test"), np.random.default_rng(0))


def test_fixed_rule_alternates_sides_closings_and_heights() -> None:
    plans = [rule(contour_heights_m=(0.018, 0.03)).plan(index) for index in range(8)]
    assert [plan.closing for plan in plans] == ["radial", "radial", "pinch", "pinch"] * 2
    assert [plan.frame.yaw_rad > 0 for plan in plans] == [False, True] * 4
    assert [plan.height_m for plan in plans] == [0.018, 0.03, 0.018, 0.03, 0.03, 0.018, 0.03, 0.018]


@pytest.mark.parametrize(
    ("top_m", "used_m"),
    [
        (None, {0.034, 0.018, 0.048}),
        (0.01, {0.015}),
        (0.022, {0.015}),
        (0.04, {0.034, 0.018}),
        (0.06, {0.034, 0.048}),
        (0.12, {0.048}),
    ],
)
def test_a_surface_is_touched_below_its_top_and_with_room_for_the_hand_above_it(
    top_m: float | None, used_m: set[float]
) -> None:
    planner = HeuristicPlanner(PlanSettings(), np.random.default_rng(0), dimension=3)
    planner.top_m = top_m
    assert {planner.height_m(index) for index in range(12)} == used_m


@pytest.mark.parametrize(
    ("top_m", "used_m"), [(None, 0.034), (0.022, 0.015), (0.04, 0.034), (0.06, 0.034), (0.09, 0.034)]
)
def test_a_contour_is_felt_below_the_top(top_m: float | None, used_m: float) -> None:
    planner = rule()
    planner.top_m = top_m
    assert planner.height_m(0) == pytest.approx(used_m)
    assert planner.settings.as_felt(top_m).contour_heights_m == pytest.approx((used_m,))


def test_a_contour_that_can_be_felt_higher_only_is_felt_there() -> None:
    felt = PlanSettings(contour_heights_m=(0.030, 0.034)).as_felt(0.06, outline_m=0.047)
    assert (felt.contour_heights_m, felt.contour_top_m) == ((0.047,), 0.06)


def test_where_links_would_meet_the_object_another_yaw_is_taken() -> None:
    plan = rule().plan(0, is_clear=lambda plan: plan.frame.yaw_rad > 0.0)
    assert plan.frame.yaw_rad > 0.0
    assert plan.height_m == 0.034


def test_where_links_would_meet_it_at_every_yaw_it_is_grasped_higher_but_below_its_top() -> None:
    planner = rule()
    planner.top_m = 0.060
    assert planner.plan(0, is_clear=lambda plan: plan.height_m > 0.040).height_m == pytest.approx(0.044)
    tried_m: list[float] = []
    given_up = planner.plan(0, is_clear=lambda plan: bool(tried_m.append(plan.height_m)))
    assert max(tried_m) <= 0.050
    assert given_up.height_m == 0.034


def test_room_for_the_fingertips_matters_more_than_links() -> None:
    plan = rule().plan(0, has_room=lambda plan: plan.frame.yaw_rad > 0.0, is_clear=lambda plan: False)
    assert plan.frame.yaw_rad > 0.0


def test_turns_keep_the_yaw_window() -> None:
    planner = rule(yaw_window_rad=(-1.0, 1.0))
    for yaw in np.linspace(-1.0, 1.0, 21):
        turn = planner.turn(float(yaw))
        assert 0.2 <= abs(turn) <= 0.8
        assert -1.0 <= yaw + turn <= 1.0


def test_turn_in_a_narrow_window_uses_the_room_there_is() -> None:
    assert rule(yaw_window_rad=(0.0, 0.1)).turn(0.02) == pytest.approx(0.08)


def test_step_back_is_bounded_and_ends_at_the_start() -> None:
    planner = rule(start_m=(0.1, 0.0), return_m=0.03)
    np.testing.assert_allclose(planner.step_back(np.array([0.2, 0.0])), [-0.03, 0.0])
    np.testing.assert_allclose(planner.step_back(np.array([0.11, 0.0])), [-0.01, 0.0])
    np.testing.assert_allclose(planner.step_back(np.array([0.1, 0.0])), [0.0, 0.0])


def touch(finger: str, x: float, y: float, frame: GraspFrame) -> Contact:
    point = np.asarray(frame.pose.transformFrom(np.array([x, y, 0.02])))
    return Contact(finger, point, np.array([1.0, 0, 0]), 1e-6 * np.eye(3), 0.05, 0.5)


def centre_of(plan: GraspPlan, **touches: tuple[float, float]) -> np.ndarray:
    contacts = tuple(touch(finger, x, y, plan.frame) for finger, (x, y) in touches.items())
    grasp = Grasp(0, 0, contacts, Pose3(Rot3(), np.zeros(3)))
    inside = plan.frame.pose.inverse().transformFrom(np.array([*contact_centre(grasp, plan), 0.0]))
    return np.asarray(inside)[:2]


FRONT = {"FF": (0.04, 0.03), "MF": (0.04, 0.01), "RF": (0.04, -0.01), "LF": (0.04, -0.03)}
SIDES = {"FF": (0.02, 0.03), "MF": (0.04, 0.01), "LF": (0.02, -0.05), "TH": (-0.02, 0.0)}


@pytest.mark.parametrize(
    ("name", "touches", "expected"),
    [
        ("pinch", {**FRONT, "TH": (-0.02, 0.0)}, (0.01, 0.0)),
        ("pinch", {"RF": (0.03, -0.01), "LF": (0.03, -0.03), "TH": (-0.03, 0.0)}, (0.0, -0.016)),
        ("radial", SIDES, (0.01, -0.01)),
        ("pinch", {"TH": (-0.02, 0.01)}, (0.01, 0.0)),
        ("pinch", FRONT, (0.01, 0.0)),
        ("radial", {}, (0.0, 0.0)),
    ],
)
def test_centre_from_contacts(
    name: str, touches: dict[str, tuple[float, float]], expected: tuple[float, float]
) -> None:
    plan = GraspPlan(GraspFrame(0.1, -0.05, 0.6), name, 0.022)
    np.testing.assert_allclose(centre_of(plan, **touches), expected, atol=1e-9)


def test_rays_are_the_usable_parts_of_the_lines() -> None:
    table = closing("radial", 0.022)
    rays = closing_rays(table)
    for index, finger in enumerate(rays.fingers):
        path = table.path(finger)
        np.testing.assert_allclose(rays.starts_m[index], path.centre_m(path.valid[0]))
        end_m = rays.starts_m[index] + rays.lengths_m[index] * rays.directions[index]
        np.testing.assert_allclose(end_m, path.centre_m(path.valid[1]), atol=1e-12)


@pytest.mark.parametrize(
    "content",
    [
        {"closings": ["scoop"]},
        {"closings": []},
        {"contour_heights_m": []},
        {"surface_heights_m": [0.5]},
        {"yaw_window_rad": [1.0, -1.0]},
        {"turn_rad": [0.5, 0.2]},
        {"unknown": 1},
    ],
)
def test_senseless_plans_are_refused(content: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError):
        validate(content, PlanSettings, where="rig.yaml")
