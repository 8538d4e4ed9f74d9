"""The joint likelihood of all poses, and the poses that a measurement proposes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from drivers.core.contacts import Array
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.slam.shape.fields.kernels import Kernel, Matern52, SquaredExponential, ThinPlate, covariance
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, compose, deviation, spatial_pose
from tactile_lab.slam.tracking.evidence.evidence_kernels import assemble, pull
from tactile_lab.slam.tracking.evidence.motion_cost import estimated_noise
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence, third_derivative
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis, HypothesisScorer
from tactile_lab.slam.tracking.joint.proposals import GraspMatch, ProposalSettings, propose, quasi_normal
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()


def disturbed(contact_map: ContactMap, scale: float, seed: int = 0) -> Array:
    shake = np.random.default_rng(seed).normal(size=contact_map.rows.shape) * [0.004, 0.004, 0.08] * scale
    shake[0] = 0.0
    return contact_map.rows + shake


@pytest.mark.parametrize(
    ("shape", "dimension", "kernel"),
    [
        ("L", 2, "matern52"),
        ("rectangle", 2, "squared_exponential"),
        ("box-12x6x6", 3, "matern52"),
        ("sphere", 3, "thin_plate"),
    ],
)
def test_the_gradient_is_the_derivative_of_the_value(shape: str, dimension: int, kernel: str) -> None:
    contact_map = true_map(
        shape, count=4, dimension=dimension, settings=GpisSettings.model_validate({"kernel": kernel})
    )
    evidence, rows = PoseEvidence(contact_map, NOISE), disturbed(contact_map, 1.0)
    value, gradient = evidence.value_and_gradient(rows)
    assert value == pytest.approx(evidence.value(rows))
    for index in np.ndindex(*rows.shape):
        step = np.zeros_like(rows)
        step[index] = 1e-6
        slope = (evidence.value(rows + step) - evidence.value(rows - step)) / 2e-6
        assert gradient[index] == pytest.approx(slope, rel=1e-4, abs=1e-2)


KERNELS = [Matern52(4e-4, 0.05), SquaredExponential(4e-4, 0.05), ThinPlate(0.3, 4e-4)]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kernel", KERNELS)
def test_the_assembled_covariance_is_that_of_the_shape_model(kernel: Kernel, dimension: int) -> None:
    points = np.random.default_rng(1).normal(size=(6, dimension)) * 0.03
    phi = kernel.profile(cdist(points, points, "sqeuclidean"))
    noise = np.linspace(0, 1, 6 * (dimension + 1))
    assembled = np.triu(assemble(points, *phi, noise, 0.0))
    np.testing.assert_allclose(assembled, np.triu(covariance(kernel, points, 6)) + np.diag(noise), atol=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kernel", KERNELS)
def test_the_pull_on_contacts_is_the_derivative_of_their_covariance(kernel: Kernel, dimension: int) -> None:
    rng = np.random.default_rng(0)
    count = 5 * (dimension + 1)
    points, inverse, weights = (
        rng.normal(size=(5, dimension)) * 0.03,
        rng.normal(size=(count, count)),
        rng.normal(size=count),
    )
    inverse += inverse.T
    squared = cdist(points, points, "sqeuclidean")
    phi = kernel.profile(squared)
    third = third_derivative(kernel, squared, phi)
    found = pull(points, phi.first, phi.second, third, np.asfortranarray(np.tril(inverse)), weights)
    factors = inverse - np.outer(weights, weights)
    for index in np.ndindex(*points.shape):
        step = np.zeros_like(points)
        step[index] = 1e-7
        change = covariance(kernel, points + step, 5) - covariance(kernel, points - step, 5)
        assert found[index] == pytest.approx(np.sum(factors * change) / 4e-7, rel=1e-3, abs=1e-6)


def spread_m(contact_map: ContactMap, rows: Array) -> float:
    """How far contacts placed by these poses stray from where the true poses place them, after the best rigid fit."""
    points = [grasp.contacts_world.points_m for grasp in contact_map.placed]
    spatial_points = [np.column_stack([planar_points, np.zeros(len(planar_points))]) for planar_points in points]
    poses = [[spatial_pose(row, 0.0) for row in each] for each in (rows, contact_map.rows)]
    error = registration_rms_mm(spatial_points, poses[0], poses[1], 2)
    assert error is not None
    return 1e-3 * error


def test_true_poses_are_likelier_than_disturbed_ones() -> None:
    contact_map = true_map("rectangle", count=8)
    evidence = PoseEvidence(contact_map, NOISE)
    assert all(
        evidence.value(contact_map.rows) < evidence.value(disturbed(contact_map, 1.0, seed)) for seed in range(5)
    )


def test_smoothing_finds_the_poses_again() -> None:
    contact_map = true_map("ellipse", count=10)
    start = disturbed(contact_map, 1.0)
    found, cost = PoseEvidence(contact_map, NOISE).maximise(start, 60)
    assert spread_m(contact_map, found) < 0.6 * spread_m(contact_map, start)
    assert cost == pytest.approx(PoseEvidence(contact_map, NOISE).value(found))


def test_leaving_one_contact_out_changes_the_evidence_by_its_cost() -> None:
    contact_map = true_map("hexagon", count=3)
    contact_map = replace(contact_map, settings=contact_map.settings.model_copy(update={"prior_mean": "zero"}))
    value = PoseEvidence(contact_map, NOISE).value(contact_map.rows)
    costs = contact_map.fit().leave_one_out_costs(np.arange(len(contact_map.contacts)))
    assert costs.shape == (len(contact_map.contacts),)
    assert HypothesisScorer(NOISE, 2.0).score(contact_map).misfit == pytest.approx(value)
    few = np.array([4, 1])
    assert contact_map.fit().leave_one_out_costs(few) == pytest.approx(costs[few])
    for origin, cost in zip(contact_map.origins, costs, strict=True):
        without = PoseEvidence(contact_map.without_contact(*origin), NOISE).value(contact_map.rows)
        assert cost == pytest.approx(value - without, abs=1e-6)


def test_a_torn_contact_costs_most() -> None:
    contact_map = true_map("ellipse", count=6)
    grasp = contact_map.placed[3]
    normals = grasp.contacts_world.normals.copy()
    normals[2] *= -1.0
    torn = replace(grasp, contacts_world=replace(grasp.contacts_world, normals=normals))
    spoiled = replace(contact_map, placed=(*contact_map.placed[:3], torn, *contact_map.placed[4:]))
    costs = spoiled.fit().leave_one_out_costs(np.arange(len(spoiled.contacts)))
    worst = int(costs.argmax())
    assert spoiled.grasp_indices[worst] == 3
    cleaned = spoiled.without_contact(*spoiled.origins[worst])
    assert cleaned.placed[3].left_out == frozenset({2})
    assert cleaned.left_out_count == 1
    assert len(cleaned.contacts) == len(spoiled.contacts) - 1
    assert np.array_equal(cleaned.grasp_indices, np.delete(spoiled.grasp_indices, worst))


def test_the_first_pose_is_given() -> None:
    contact_map = true_map("rectangle", count=3)
    found, _ = PoseEvidence(contact_map, NOISE).maximise(disturbed(contact_map, 1.0), 10)
    assert np.array_equal(found[0], contact_map.rows[0])


def test_a_grasp_without_contacts_follows_the_motion_model() -> None:
    contact_map = true_map("rectangle", count=4)
    last = contact_map.placed[-1]
    empty = PlacedGrasp(
        last.contacts_world.select(np.zeros(len(last.contacts_world), dtype=bool)),
        last.pose + 0.01,
        last.covariance,
        last.motion,
    )
    found, _ = PoseEvidence(contact_map_of(contact_map, empty), NOISE).maximise(
        contact_map.rows + np.array([[0], [0], [0], [0.01]]), 300, accuracy=1e-9
    )
    assert np.allclose(found[-1], compose(last.motion, found[-2]), atol=5e-4)


def contact_map_of(contact_map: ContactMap, last: PlacedGrasp) -> ContactMap:
    return ContactMap((*contact_map.placed[:-1], last), contact_map.settings)


def test_proposals_contain_the_true_pose() -> None:
    contact_map = true_map("rectangle", count=8)
    known = ContactMap(contact_map.placed[:7], contact_map.settings)
    last = contact_map.placed[7]
    predicted = compose(last.motion, contact_map.rows[6])
    rows, fit = propose(predicted, last.contacts_world, known.fit(), NOISE, ProposalSettings())
    gaps = deviation(rows, last.pose)
    assert np.any((np.hypot(gaps[:, 0], gaps[:, 1]) < 0.004) & (np.abs(gaps[:, 2]) < 0.1))
    assert np.all(np.diff(fit.cost) >= 0)


def test_proposals_differ_from_each_other() -> None:
    contact_map = true_map("ellipse", count=5)
    settings = ProposalSettings(kept=5)
    last = contact_map.placed[-1]
    rows, _ = propose(last.pose, last.contacts_world, contact_map.fit(), NOISE, settings)
    assert len(rows) <= 5
    for index, row in enumerate(rows):
        gaps = deviation(np.delete(rows, index, axis=0), row)
        assert np.all(
            (np.hypot(gaps[:, 0], gaps[:, 1]) >= settings.distinct_m) | (np.abs(gaps[:, 2]) >= settings.distinct_rad)
        )


def test_the_information_is_a_second_derivative_near_a_good_fit() -> None:
    contact_map = true_map("rectangle", count=8)
    last = contact_map.placed[-1]
    match = GraspMatch(last.pose, last.contacts_world, contact_map.fit(), NOISE, ProposalSettings())
    fit = match.fit(last.pose[None], match.variance(last.pose[None]))
    sigma = np.sqrt(np.diag(np.linalg.inv(fit.information[0])))
    assert np.all(sigma[:2] < 0.004)
    assert sigma[2] < 0.1


def test_quasi_random_samples_are_normal_and_always_the_same() -> None:
    drawn = quasi_normal(256, 3)
    assert np.allclose(drawn.mean(axis=0), 0.0, atol=0.05)
    assert np.allclose(drawn.std(axis=0), 1.0, atol=0.05)
    drawn[:] = 0.0
    assert not np.any(np.all(quasi_normal(256, 3) == 0.0, axis=1))


@pytest.mark.parametrize("scale", [0.3, 3.0])
def test_the_noise_of_the_motion_is_learnt_from_the_slips(scale: float) -> None:
    contact_map = true_map("rectangle", count=16)
    configured = MotionNoise(translation_m=0.010 * scale, rotation_rad=float(np.deg2rad(20.0)) * scale)
    learnt = estimated_noise(contact_map, configured)
    assert abs(np.log(learnt.translation_m / 0.010)) < 0.7 * abs(np.log(scale))
    assert abs(np.log(learnt.rotation_rad / np.deg2rad(20.0))) < 0.7 * abs(np.log(scale))


def test_trajectories_are_one_where_the_contacts_leave_the_difference_open() -> None:
    contact_map = true_map("ellipse", count=6)
    scorer = HypothesisScorer(NOISE, 2.0)
    variances, ways = np.linalg.eigh(np.linalg.inv(PoseEvidence(contact_map, NOISE).information(contact_map.rows)))
    length = 2 * np.sqrt(variances[-1])

    def moved(way: Array) -> Hypothesis:
        return scorer.score(contact_map.with_rows(contact_map.rows + np.vstack([np.zeros(3), way.reshape(-1, 3)])))

    best, open_way, certain_way = scorer.score(contact_map), moved(length * ways[:, -1]), moved(length * ways[:, 0])
    assert np.abs(open_way.map.rows - contact_map.rows).max() > 0.03
    assert len(scorer.different([best, open_way])) == 1
    assert len(scorer.different([best, certain_way])) == 2
    assert scorer.unlike([certain_way, open_way], [best]) == [certain_way]
