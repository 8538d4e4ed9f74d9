"""Errors that all contacts of a finger share: how poses and faces follow them, and what that adds to sigma."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import FINGERS, Array, Contact
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.shared_errors import ALL_FINGERS, SharedErrors
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother
from tactile_lab.slam.tracking.faces.flat_faces import flat_faces
from tactile_lab.slam.tracking.joint.pose_uncertainty import propagate_pose_uncertainty
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()
SHARED_m = 0.0008


def with_shared_errors(known: ContactMap, sigma_m: float = SHARED_m) -> ContactMap:
    """The map with an error that each finger shares with itself; the fingers of a grasp are in order."""
    placed = []
    for grasp in known.placed:
        count = len(grasp.contacts_world)
        shared = SharedErrors(np.array(FINGERS[:count]), np.full(count, sigma_m))
        placed.append(replace(grasp, contacts_world=replace(grasp.contacts_world, shared=shared)))
    return replace(known, placed=tuple(placed))


@pytest.fixture(scope="module")
def known() -> ContactMap:
    return with_shared_errors(true_map("rectangle", seed=4))


def shifted(known: ContactMap, finger: str, by_m: float) -> ContactMap:
    """The map with all contacts of one finger moved along their normals."""
    placed = []
    for grasp in known.placed:
        seen = grasp.contacts_world
        away = np.where(seen.shared.fingers == finger, by_m, 0.0)[:, None] * seen.normals
        placed.append(replace(grasp, contacts_world=replace(seen, points_m=seen.points_m + away)))
    return replace(known, placed=tuple(placed))


def test_faces_follow_a_finger_that_feels_too_far_out_as_the_smoother_does(known: ContactMap) -> None:
    faces, _ = flat_faces(known)
    smoother = FacetSmoother(known, NOISE)
    before = smoother.fit(known.rows, faces, 30)
    moved = replace(known, placed=known.placed).with_rows(before.rows)
    foretold = FacetSmoother(moved, NOISE).response(
        before.rows, before.faces, moved.contacts_world.shared.displacements_m()
    )
    thumb = sorted(FINGERS).index("TH")
    after = FacetSmoother(shifted(moved, "TH", SHARED_m), NOISE).fit(before.rows, before.faces, 30)
    offsets = foretold[(len(before.rows) - 1) * 3 :, thumb].reshape(-1, 2)[:, 1]
    found_m = after.faces.offsets_m - before.faces.offsets_m
    assert np.abs(found_m).max() > 1e-4
    np.testing.assert_allclose(offsets, found_m, atol=0.15 * np.abs(found_m).max())


def test_more_grasps_reduce_the_sensors_noise_and_not_what_a_finger_shares(known: ContactMap) -> None:
    def added_m(contact_map: ContactMap) -> float:
        certainty = FacetCertainty.of(contact_map, NOISE)
        places = contact_map.contacts
        by_fingers = certainty.shared_change(places.points_m, places.normals)
        return float(np.sqrt(np.mean(np.sum(by_fingers**2, axis=1))))

    many = with_shared_errors(true_map("rectangle", seed=4, count=24))
    assert 0.2 * SHARED_m < added_m(many) < SHARED_m
    assert added_m(many) > 0.8 * added_m(known)
    assert added_m(with_shared_errors(known, 0.0)) == 0.0


def test_what_fingers_share_is_counted_once(known: ContactMap) -> None:
    shape = best_shape(known.fit())
    contour = shape.contour()
    without = propagate_pose_uncertainty(contour, shape, with_shared_errors(known, 0.0), NOISE)
    once = propagate_pose_uncertainty(contour, shape, known, NOISE)
    assert without.shared_sigma_m == 0.0
    assert 0.2 * SHARED_m < once.shared_sigma_m < SHARED_m
    own = once.sigma_m**2 - once.shared_sigma_m**2
    assert 0.2 * np.median(without.sigma_m**2) < np.median(own) < 0.9 * np.median(without.sigma_m**2)


def test_an_error_that_all_fingers_have_makes_the_outline_larger_or_smaller_by_all_of_it(known: ContactMap) -> None:
    shape = best_shape(known.fit())
    placed = []
    for grasp in known.placed:
        shared = replace(grasp.contacts_world.shared, fingers=np.full(len(grasp.contacts_world), ALL_FINGERS))
        placed.append(replace(grasp, contacts_world=replace(grasp.contacts_world, shared=shared)))
    theirs = propagate_pose_uncertainty(shape.contour(), shape, replace(known, placed=tuple(placed)), NOISE)
    each = propagate_pose_uncertainty(shape.contour(), shape, known, NOISE)
    assert theirs.shared_sigma_m == pytest.approx(SHARED_m, rel=0.05)
    assert each.shared_sigma_m < 0.8 * theirs.shared_sigma_m


def test_an_error_that_each_contact_has_by_itself_is_that_of_its_variance(known: ContactMap) -> None:
    """Every contact by a finger of its own: the shared error is drawn anew at each, and sigma is as without it."""
    shape = best_shape(known.fit())
    contour, count = shape.contour(), 0
    placed = []
    for grasp in known.placed:
        fingers = np.array([f"{count + each:03}" for each in range(len(grasp.contacts_world))])
        count += len(fingers)
        shared = SharedErrors(fingers, np.full(len(fingers), SHARED_m))
        placed.append(replace(grasp, contacts_world=replace(grasp.contacts_world, shared=shared)))
    apart = propagate_pose_uncertainty(contour, shape, replace(known, placed=tuple(placed)), NOISE)
    without = propagate_pose_uncertainty(contour, shape, with_shared_errors(known, 0.0), NOISE)
    np.testing.assert_allclose(apart.sigma_m, without.sigma_m, rtol=1e-6)


@pytest.mark.parametrize("shared_m", [0.001, 0.002], ids=["all of it", "more than all"])
def test_sigma_stays_positive_where_contacts_state_nothing_of_their_own(known: ContactMap, shared_m: float) -> None:
    shape = best_shape(known.fit())
    stated = propagate_pose_uncertainty(shape.contour(), shape, with_shared_errors(known, shared_m), NOISE)
    assert np.isfinite(stated.sigma_m).all()
    assert stated.sigma_m.min() > 0


def test_contacts_keep_their_fingers_where_they_are_selected_moved_and_gathered() -> None:
    covariance: Array = np.diag([4e-8, 0.0, 0.0])
    given = [Contact(finger, np.zeros(3), np.eye(3)[0], shared_covariance_m2=covariance) for finger in ("FF", "TH")]
    shared = SharedErrors.of(given, np.eye(3)[[0, 1]])
    np.testing.assert_allclose(shared.sigma_m, [2e-4, 0.0])
    assert SharedErrors.of([replace(given[0], shared_by_all=True)], np.eye(3)[:1]).fingers.tolist() == [ALL_FINGERS]
    one = ContactSet(np.zeros((2, 2)), np.eye(2), np.ones(2), np.ones(2), shared=shared)
    unknown = ContactSet(np.zeros((1, 2)), np.eye(2)[:1], np.ones(1), np.ones(1))
    both = ContactSet.concatenate([unknown, one.select(np.array([1, 0])).in_object_frame(np.zeros(3))])
    assert both.shared.fingers.tolist() == ["", "TH", "FF"]
    np.testing.assert_allclose(both.shared.displacements_m()[:, 1], [0.0, 0.0, 2e-4])
