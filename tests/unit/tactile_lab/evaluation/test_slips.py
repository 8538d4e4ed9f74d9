"""How far objects slip, and the motion of a rig that fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2, Pose3

from drivers.core.contacts import Grasp, StepSigma
from drivers.core.poses import spatial
from tactile_lab.evaluation.felt_slips import FeltSlips
from tactile_lab.evaluation.slips import LEAST_STEPS, Slips
from tactile_lab.slam.tracking.contacts.motion import UNHELD


def grasp(index: int, hand_motion: Pose2) -> Grasp:
    return Grasp(index, index, (), Pose3(), spatial(hand_motion, 0.0))


def session(slips: list[tuple[Pose2, Pose2]]) -> tuple[list[Grasp], list[Pose3]]:
    """Grasps and true poses, from the hand's motion before each grasp but the first, and the slip in the world."""
    grasps, where = [grasp(0, Pose2())], [Pose2(0.02, -0.01, 0.4)]
    for index, (motion, slip) in enumerate(slips, start=1):
        grasps.append(grasp(index, motion))
        moved = motion.compose(where[-1])
        where.append(Pose2(moved.x() + slip.x(), moved.y() + slip.y(), moved.theta() + slip.theta()))
    return grasps, [spatial(each, 0.03) for each in where]


def drawn(rng: np.random.Generator, count: int, sigma_m: float, sigma_rad: float) -> list[Pose2]:
    return [Pose2(*row) for row in rng.normal(size=(count, 3)) * [sigma_m, sigma_m, sigma_rad]]


def test_a_slip_is_what_the_object_moved_beside_the_hand() -> None:
    carry, slip = Pose2(0.05, 0.02, 1.0), Pose2(0.003, -0.004, 0.1)
    found = Slips.between(*session([(carry, slip), (Pose2(), Pose2(0.001, 0.0, 0.0)), (carry, Pose2())]))
    np.testing.assert_allclose(found.carried, [[0.003, -0.004, 0.1], [0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(found.left, [[0.001, 0, 0]], atol=1e-12)


def test_grasps_that_the_camera_did_not_see_tell_no_slip() -> None:
    grasps, poses = session([(Pose2(), Pose2(0.001 * n, 0, 0)) for n in range(1, 5)])
    assert len(Slips.between(grasps, [*poses[:2], None, *poses[3:]]).left) == 2
    assert len(Slips.between(grasps, [None] * 5).left) == 0
    assert len(Slips.between([], []).carried) == 0


def test_the_motion_that_fits_is_the_one_that_slips_were_drawn_with() -> None:
    rng = np.random.default_rng(5)
    carried = [(Pose2(0.03, 0.0, 0.5), slip) for slip in drawn(rng, 300, 0.006, 0.15)]
    lying = [(Pose2(), slip) for slip in drawn(rng, 240, 0.0006, 0.015)]
    pushed = [(Pose2(), slip) for slip in drawn(rng, 30, 0.008, 0.1)]
    slips = Slips.join([Slips.between(*session(carried)), Slips.between(*session(lying + pushed))])
    motion = slips.motion
    assert motion is not None
    assert motion.translation_m == pytest.approx(0.006, rel=0.1)
    assert motion.rotation_rad == pytest.approx(0.15, rel=0.1)
    assert motion.unheld == pytest.approx(0.12, abs=0.02)  # pushes widen it a little
    assert 24 <= slips.pushed_count(motion) <= 33


def test_too_few_steps_tell_nothing_and_an_object_seldom_left_is_said_to_lie_as_still_as_usual() -> None:
    rng = np.random.default_rng(6)
    carried = [(Pose2(0.03, 0.0, 0.5), slip) for slip in drawn(rng, LEAST_STEPS, 0.006, 0.15)]
    assert Slips.between(*session(carried[1:])).motion is None
    found = Slips.between(*session([*carried, (Pose2(), Pose2())])).motion
    assert found is not None
    assert found.unheld == UNHELD


def test_an_object_that_never_moves_is_not_said_to_lie_as_still_as_a_rock() -> None:
    rng = np.random.default_rng(7)
    carried = [(Pose2(0.03, 0.0, 0.5), slip) for slip in drawn(rng, 20, 0.006, 0.15)]
    found = Slips.between(*session(carried + [(Pose2(), Pose2())] * 20)).motion
    assert found is not None
    assert found.unheld == 0.02


def test_an_object_that_is_left_but_turns_is_not_said_to_lie_still() -> None:
    rng = np.random.default_rng(8)
    carried = [(Pose2(0.03, 0.0, 0.5), slip) for slip in drawn(rng, 300, 0.006, 0.15)]
    turning = [(Pose2(), slip) for slip in drawn(rng, 300, 0.0006, 0.06)]
    found = Slips.between(*session(carried + turning)).motion
    assert found is not None
    assert found.unheld == pytest.approx(0.4, abs=0.05)


def test_what_was_felt_is_judged_by_what_it_said_of_its_own_error() -> None:
    rng = np.random.default_rng(7)
    grasps, poses = session([(Pose2(0.03, 0.0, 0.5), slip) for slip in drawn(rng, 400, 0.002, 0.04)])
    felt = [replace(each, motion_sigma=StepSigma(0.001, 0.02)) for each in grasps]
    found = FeltSlips.join([FeltSlips.between(felt, poses), FeltSlips.between(grasps, poses)])
    assert len(found.missed) == 400  # those of the second session were not felt
    assert found.scale == pytest.approx(2.2, abs=0.2)  # 2, of a law that has more far ones than these
    lengths, turns = found.share_within(2.0)  # 2.05 standard deviations of what was stated
    assert lengths == pytest.approx(0.69, abs=0.05)
    assert turns == pytest.approx(0.69, abs=0.07)
    assert "odometry_scale by 2." in found.in_words()
    assert FeltSlips().scale is None


def test_one_dropped_object_does_not_widen_the_noise_of_all() -> None:
    rng = np.random.default_rng(3)
    stated = np.tile([0.001, 0.02], (40, 1))
    missed = rng.standard_normal((40, 3)) * stated[:, [0, 0, 1]]
    with_one = missed.copy()
    with_one[7] = [0.4, 0.0, 2.0]
    scale = FeltSlips(missed, stated).scale
    assert scale is not None
    assert FeltSlips(with_one, stated).scale == pytest.approx(scale, rel=0.1)
