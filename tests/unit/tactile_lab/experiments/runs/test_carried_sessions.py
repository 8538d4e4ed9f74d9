"""Sessions in which objects are carried: what is left without odometry, and the farthest slide."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from gtsam import Pose3, Rot3

from drivers.core.contacts import Grasp, StepSigma
from tactile_lab.experiments.runs.carried_sessions import farthest_slide, moved_with_the_palm
from tactile_lab.experiments.thesis.rig_sessions import RigSession


def shifted(x_m: float, turn_rad: float = 0.0) -> Pose3:
    return Pose3(Rot3.Rz(turn_rad), np.array([x_m, 0.0, 0.0]))


def session() -> RigSession:
    """The palm moves by 30 mm twice; the object follows by 28 and by 15 mm, of which 13 of 15 are felt."""
    felt = [(Pose3(), None), (shifted(0.028), StepSigma(0.001, 0.01)), (shifted(0.017), StepSigma(0.002, 0.02))]
    grasps = tuple(
        Grasp(index, index, (), hand_motion_world=motion, motion_sigma=sigma)
        for index, (motion, sigma) in enumerate(felt)
    )
    true = (shifted(0.0), shifted(0.028), shifted(0.043))
    return RigSession(trimesh.creation.box((0.1, 0.06, 0.04)), grasps, true, (Pose3(), shifted(0.03), shifted(0.03)))


def test_without_odometry_the_object_moves_with_the_palm_at_the_usual_noise() -> None:
    found = list(moved_with_the_palm(session()))
    assert [grasp.motion_sigma for grasp in found] == [None] * 3
    assert [round(1e3 * grasp.hand_motion_world.x()) for grasp in found] == [0, 30, 30]


def test_the_farthest_slide_and_what_odometry_said_of_it() -> None:
    told = farthest_slide(session())
    assert told["slid_mm"] == pytest.approx(15.0)
    assert told["said_mm"] == pytest.approx(13.0)
    assert told["said_off_mm"] == pytest.approx(2.0)
    assert told["said_sigma_mm"] == pytest.approx(2.0)


def test_a_turn_about_a_far_origin_is_no_slide_of_the_middle() -> None:
    one = session()
    far = Pose3(Rot3(), np.array([0.4, 0.0, 0.0]))
    turned = [Pose3(Rot3.Rz(0.2), np.zeros(3)) * far, far]
    about = turned[0] * far.inverse()
    still = RigSession(one.mesh, one.grasps[:2], (far, turned[0]), (Pose3(), about))
    assert farthest_slide(still)["slid_mm"] == pytest.approx(0.0, abs=1e-6)


def test_an_object_that_was_grasped_once_never_slid() -> None:
    one = session()
    alone = RigSession(one.mesh, one.grasps[:1], one.world_T_body[:1], one.palm_motions[:1])
    assert farthest_slide(alone) == {"slid_mm": None, "said_mm": None, "said_off_mm": None, "said_sigma_mm": None}
