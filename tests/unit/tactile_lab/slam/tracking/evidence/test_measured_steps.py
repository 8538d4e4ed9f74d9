"""Steps that the fingertips measured: a noise of their own, with heavy tails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.tracking.contacts.contact_map import Moved
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost, estimated_noise
from tactile_lab.slam.tracking.joint.proposals import GraspMatch, ProposalSettings, propose
from tests.support.simulated_contacts import true_map

USUAL = MotionNoise()
OWN = StepSigma(0.001, 0.02)
MOTIONS = np.array([[0.0, 0.0, 0.0], [0.02, 0.01, 0.4], [0.01, -0.02, -0.3]])


def rows(slip: Array) -> Array:
    """Poses of which the last step slips."""
    second = PLANAR.compose(MOTIONS[1], np.zeros(3))
    return np.array([np.zeros(3), second, PLANAR.compose(MOTIONS[2], second) + slip])


def cost_of(slip: Array, measured: tuple[StepSigma | None, ...] = (None, None, OWN)) -> float:
    return MotionCost(MOTIONS, USUAL, PLANAR, measured=measured).value(rows(slip))


def test_a_small_slip_costs_what_its_own_noise_says() -> None:
    assert cost_of(np.array([0.001, 0.0, 0.0])) == pytest.approx(3.5 * np.log(4 / 3))
    assert cost_of(np.array([0.001, 0.0, 0.0]), (None, None, None)) == pytest.approx(0.005)


def test_a_step_that_is_off_by_ten_sigma_can_still_be_believed() -> None:
    assert 10 < cost_of(np.array([0.010, 0.0, 0.0])) < 15


def test_the_gradient_is_the_derivative_of_the_value() -> None:
    cost = MotionCost(MOTIONS, USUAL, PLANAR, measured=(None, OWN, OWN))
    poses = rows(np.array([0.004, -0.003, 0.05])) + 0.001
    _, gradient = cost.value_and_gradient(poses)
    for index in np.ndindex(*poses.shape):
        step = np.zeros_like(poses)
        step[index] = 1e-7
        slope = (cost.value(poses + step) - cost.value(poses - step)) / 2e-7
        assert gradient[index] == pytest.approx(slope, rel=1e-4, abs=1e-3)


def test_a_step_that_is_off_tells_less() -> None:
    cost = MotionCost(MOTIONS, USUAL, PLANAR, measured=(None, None, OWN))
    near, far = (cost.information(rows(np.array([slip, 0.0, 0.0])))[3, 3] for slip in (0.0, 0.02))
    assert near == pytest.approx(1 / OWN.translation_m**2)
    assert far < near / 10


def test_an_object_that_moved_freely_is_not_bound_by_what_was_felt() -> None:
    moved = (Moved.AS_MEANT, Moved.AS_MEANT, Moved.FREELY)
    free = MotionCost(MOTIONS, USUAL, PLANAR, moved, (None, None, OWN))
    assert free.value(rows(np.array([0.3, 0.0, 0.0]))) < 0.1


def test_steps_without_a_measurement_between_them_add_up() -> None:
    both = USUAL.over(MOTIONS[1:], [OWN, OWN])
    assert both.translation_m == pytest.approx(np.sqrt(2) * OWN.translation_m)
    assert both.wide == USUAL
    assert USUAL.over(MOTIONS[1:], [OWN, None]) == USUAL.accumulate(2)


def test_a_measured_step_says_nothing_about_the_usual_noise() -> None:
    placed = true_map("L", count=4)
    felt = [replace(grasp, motion_sigma=OWN, motion=grasp.motion + 0.05) for grasp in placed.placed]
    assert estimated_noise(replace(placed, placed=tuple(felt)), USUAL) == USUAL


def test_poses_are_searched_where_an_unmeasured_step_may_lead() -> None:
    """The contacts say 8 mm from where the step leads, with 1 mm: half of the samples look there."""
    known = true_map("L", count=6)
    last, field = known.placed[-1], known.without_grasp(5).fit()
    predicted = last.pose + np.array([0.006, -0.005, 0.0])
    noise = USUAL.after(np.ones(3), OWN)
    found, _ = propose(predicted, last.contacts_world, field, noise, ProposalSettings())
    nearest = np.linalg.norm((found - last.pose)[:, :2], axis=1).min()
    assert nearest < 0.0035
    match = GraspMatch(predicted, last.contacts_world, field, noise, ProposalSettings())
    fit = match.fit(last.pose[None], match.variance(last.pose[None]))
    assert np.isfinite(fit.cost).all()
    assert np.linalg.eigvalsh(fit.information[0]).min() > 0
