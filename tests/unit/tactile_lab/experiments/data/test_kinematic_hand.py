"""The hand without physics: where its fingertips stop on a true surface, and a whole session with it."""

from __future__ import annotations

import numpy as np
import pytest
from gtsam import Pose2, Pose3

from drivers.core.contacts import StepSigma
from drivers.core.poses import spatial, transform_points
from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.autonomy.planner import Reorientation
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.kinematic_hand import FELT, KinematicHand
from tactile_lab.experiments.data.solids import solid
from tactile_lab.experiments.runs.kinematic_exploration import explore_by_kinematics

WINDOW_rad = (-1.31, 1.31)
MIDDLE = GraspFrame(0.0, 0.0, 0.0)


def hand(shape: str, place: Pose2, seed: int = 0, felt: StepSigma | None = None) -> KinematicHand:
    body = solid(shape)
    made = KinematicHand(body, CycleSettings(), HandShape(), WINDOW_rad, np.random.default_rng(seed), felt)
    made.world_T_body = spatial(place, -body.foot_m)
    return made


def test_contacts_lie_on_the_surface_within_the_sensors_noise() -> None:
    own = hand("box-10x6x4", Pose2(0.0, 0.0, np.pi / 2))
    attempt = own.attempt(GraspPlan(MIDDLE, "radial", 0.028))
    assert attempt.grasp is not None
    assert len(attempt.grasp.touching) >= 4
    seen = transform_points(own.world_T_body.inverse(), attempt.grasp.points_world_m)
    assert solid("box-10x6x4").nearest(seen)[0].max() < 0.004
    assert len(attempt.grasp.approach_paths) == 5


def test_a_tap_touches_the_top_and_its_contacts_are_probed() -> None:
    own = hand("box-10x6x4", Pose2())
    plan = GraspPlan(GraspFrame(0.0, 0.0, 1.2), "radial", 0.028, tap=True)
    attempt = own.attempt(plan)
    assert attempt.grasp is not None
    probed = [contact for contact in attempt.grasp.contacts if contact.probed]
    assert len(probed) >= 3
    assert [contact.point_world_m[2] for contact in probed] == pytest.approx([0.04] * len(probed), abs=4e-3)


def test_a_hand_that_comes_down_on_the_object_moves_aside_and_tells() -> None:
    own = hand("box-12x6x6", Pose2(0.03, 0.0, 0.0))
    attempt = own.attempt(GraspPlan(MIDDLE, "pinch", 0.028))
    assert attempt.landings_world_m
    assert attempt.plan.frame != MIDDLE


def test_a_grasp_beside_the_object_has_no_contacts_and_lines_that_met_nothing() -> None:
    attempt = hand("cube-6", Pose2(0.3, 0.0, 0.0)).attempt(GraspPlan(MIDDLE, "pinch", 0.028))
    assert attempt.grasp is not None
    assert attempt.grasp.contacts == ()
    assert not any(line.touched for line in attempt.grasp.approach_paths)


def test_a_held_object_goes_with_the_hand_but_for_its_slip_and_the_next_grasp_knows() -> None:
    own = hand("cube-6", Pose2())
    attempt = own.attempt(GraspPlan(MIDDLE, "pinch", 0.028))
    before = own.world_T_body
    motion = own.carry(Reorientation(0.5, np.array([0.03, 0.0])), attempt).world
    strayed = (motion * before).between(own.world_T_body)
    assert 0.0 < np.linalg.norm(strayed.translation()) < 0.025
    assert np.asarray(motion.translation())[:2] == pytest.approx([0.03, 0.0], abs=1e-9)
    held = own.world_T_body
    assert own.carry(Reorientation(0.0, np.zeros(2)), attempt).world.equals(Pose3(), 1e-12)  # it is left where it is
    assert own.world_T_body.equals(held, 1e-12)
    following = own.attempt(GraspPlan(GraspFrame(0.03, 0.0, 0.5), "pinch", 0.028)).grasp
    assert following is not None
    assert following.hand_motion_world.equals(motion, 1e-12)


def test_a_hand_that_feels_its_object_tells_the_slip_and_how_well_until_the_next_grasp() -> None:
    own = hand("cube-6", Pose2(), felt=FELT)
    attempt = own.attempt(GraspPlan(MIDDLE, "pinch", 0.028))
    before = own.world_T_body
    motion = own.carry(Reorientation(0.5, np.array([0.03, 0.0])), attempt).world
    off = np.asarray((motion * before).between(own.world_T_body).translation())
    assert 0.0 < np.linalg.norm(off) < 0.002
    frame = GraspFrame(0.03, 0.0, 0.5)
    carried, left = (own.attempt(GraspPlan(frame, "pinch", 0.028)).grasp for _ in range(2))
    assert carried is not None
    assert left is not None
    assert carried.motion_sigma is not None
    assert carried.motion_sigma.translation_m == pytest.approx(0.0007, abs=1e-4)
    assert left.motion_sigma is None


def test_a_short_session_is_judged() -> None:
    setting = (("object", "cube-6"), ("dimension", 2), ("policy", "information"), ("actions", 3))
    figures = explore_by_kinematics(Cell(setting, 1))
    assert figures["status"] == "not explored"
    assert figures["contacts"] >= 9
    assert figures["registration_mm"] < 5.0
    assert (figures["actions_A"], figures["at_most_A"]) == (None, 3)  # not reached, so the budget counts
    for measure in ("A", "B", "touched"):
        curve = figures[f"curve_{measure}"]
        assert len(curve) == 4
        assert curve[0] == 0.0
        assert 0.0 < curve[3] < 1.0
        assert figures[f"area_{measure}"] == pytest.approx(np.mean(curve[1:]), abs=1e-3)
    assert figures["curve_touched"] == sorted(figures["curve_touched"])  # what was touched stays touched
    (promised, touched) = figures["promises"][0]  # the first two grasps follow the fixed rule
    assert touched == pytest.approx(figures["curve_touched"][3] - figures["curve_touched"][2], abs=1e-3)
    assert promised == pytest.approx(touched, abs=0.15)
