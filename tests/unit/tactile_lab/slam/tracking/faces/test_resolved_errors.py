"""Errors of fingers that are estimated with poses and faces, because contacts say how each error moves them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import FINGERS, Array
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.shared_errors import SharedErrors
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother
from tactile_lab.slam.tracking.faces.flat_faces import flat_faces
from tactile_lab.slam.tracking.faces.resolved_errors import with_errors_resolved
from tactile_lab.slam.tracking.joint.pose_covariance import PoseCovariances
from tactile_lab.slam.tracking.joint.pose_uncertainty import propagate_pose_uncertainty
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()
SHARED_m = 0.0008


def felt_by_a_hand(known: ContactMap, seed: int) -> tuple[ContactMap, dict[str, Array]]:
    """The map as a hand feels it that has two errors a finger, displaced as each grasp has it; and the errors."""
    rng = np.random.default_rng(seed)
    errors = {finger: rng.normal(size=2) for finger in FINGERS}
    placed = []
    for grasp in known.placed:
        seen = grasp.contacts_world
        angles = rng.uniform(0.0, np.pi / 2, len(seen))
        moves = SHARED_m * np.column_stack([np.cos(angles), np.sin(angles)])
        shared = SharedErrors(np.array(FINGERS[: len(seen)]), np.linalg.norm(moves, axis=1), moves)
        points = seen.points_m + shared.offsets_m(errors)[:, None] * seen.normals
        sigma_m = np.hypot(seen.point_sigma_m, shared.sigma_m)
        placed.append(
            replace(grasp, contacts_world=replace(seen, points_m=points, point_sigma_m=sigma_m, shared=shared))
        )
    return replace(known, placed=tuple(placed)), errors


def smoothed(contact_map: ContactMap) -> ContactMap:
    """The map with the poses that fit best to flat faces."""
    faces, _ = flat_faces(contact_map)
    return contact_map.with_rows(FacetSmoother(contact_map, NOISE).fit(contact_map.rows, faces, 30).rows)


@pytest.fixture(scope="module")
def resolved() -> ContactMap:
    return with_errors_resolved(smoothed(felt_by_a_hand(true_map("rectangle", seed=4, count=16), 1)[0]), NOISE)


def test_places_of_contacts_are_nearer_to_the_true_ones() -> None:
    before_m, after_m = [], []
    for seed in range(6):
        known = true_map("rectangle", seed=seed, count=16)
        felt = smoothed(felt_by_a_hand(known, seed)[0])
        for found, errors_m in ((felt, before_m), (with_errors_resolved(felt, NOISE), after_m)):
            assert found.dimension == 2
            away = np.einsum(
                "nd,nd->n", found.contacts_world.points_m - known.contacts_world.points_m, found.contacts_world.normals
            )
            errors_m.append(float(np.sqrt(np.mean(away**2))))
    assert np.mean(after_m) < 0.6 * np.mean(before_m)


def test_contacts_that_do_not_say_how_errors_move_them_stay_as_they_are() -> None:
    known = true_map("rectangle", seed=4)
    assert with_errors_resolved(known, NOISE) is known
    felt, _ = felt_by_a_hand(known, 1)
    placed = [
        replace(one, contacts_world=replace(seen, shared=SharedErrors(seen.shared.fingers, seen.shared.sigma_m)))
        for one in felt.placed
        for seen in [one.contacts_world]
    ]
    summed_up = replace(felt, placed=tuple(placed))
    assert with_errors_resolved(summed_up, NOISE) is summed_up


def test_what_remains_unknown_is_part_of_all_covariances(resolved: ContactMap) -> None:
    """Total covariance: of the unknowns with errors unknown is that with errors known, and what the errors leave."""
    faces, _ = flat_faces(resolved)
    smoother = FacetSmoother(resolved, NOISE)
    total = np.linalg.inv(smoother.information(resolved.rows, faces))
    known = np.linalg.inv(smoother.information(resolved.rows, faces, given_errors=True))
    left = smoother.by_shared_errors(resolved.rows, faces)
    assert left.shape == (len(total), 2 * len(FINGERS))
    np.testing.assert_allclose(known + left @ left.T, total, rtol=1e-3, atol=1e-4 * np.abs(total).max())


def test_outline_and_poses_are_as_much_more_certain(resolved: ContactMap) -> None:
    felt = smoothed(felt_by_a_hand(true_map("rectangle", seed=4, count=16), 1)[0])
    sigmas_m, shared_m, poses = [], [], []
    for each in (felt, resolved):
        shape = best_shape(each.fit())
        stated = propagate_pose_uncertainty(shape.contour(), shape, each, NOISE)
        sigmas_m.append(np.median(stated.sigma_m))
        shared_m.append(stated.shared_sigma_m)
        poses.append(np.median([np.trace(one[:2, :2]) for one in PoseCovariances.of(each, NOISE).common]))
    assert 0.0 < shared_m[1] < 0.9 * shared_m[0]
    assert sigmas_m[1] < 0.9 * sigmas_m[0]
    assert poses[1] < poses[0]


def test_free_places_move_with_their_contacts(resolved: ContactMap) -> None:
    felt, _ = felt_by_a_hand(true_map("rectangle", seed=4, count=16), 1)
    for before, after in zip(felt.placed, resolved.placed, strict=True):
        one, other = before.contacts_world, after.contacts_world
        touching = one.free_of >= 0
        moved = (other.points_m - one.points_m)[one.free_of[touching]]
        np.testing.assert_allclose((other.free_m - one.free_m)[touching], moved, atol=1e-12)
        np.testing.assert_array_equal(other.free_m[~touching], one.free_m[~touching])


def test_contacts_that_state_different_numbers_of_errors_are_put_together() -> None:
    two = SharedErrors(np.array(["FF"]), np.array([1.0]), np.array([[0.6, 0.8]]))
    none = SharedErrors(np.array(["MF", "FF"]), np.zeros(2))
    both = SharedErrors.concatenate([two, none])
    np.testing.assert_array_equal(both.moves_m, [[0.6, 0.8], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_array_equal(both.offsets_m({"FF": np.array([1.0, 1.0])}), [1.4, 0.0, 0.0])
    assert both.can_be_estimated
    assert both.by_errors_m().shape == (3, 0)
    np.testing.assert_array_equal(both.taken_out().by_errors_m(), [[0.6, 0.8, 0.0, 0.0], [0] * 4, [0] * 4])


def test_poses_that_would_move_farther_than_errors_explain_stay() -> None:
    """Poses far from those that fit best: faces would move them, not errors."""
    felt = felt_by_a_hand(true_map("rectangle", seed=4, count=16), 1)[0]
    rows = felt.rows + np.where(np.arange(len(felt.rows)) % 2, 1, -1)[:, None] * [0.0, 0.0, 0.15]
    rows[0] = felt.rows[0]
    away = felt.with_rows(rows)
    assert with_errors_resolved(away, NOISE) is away
