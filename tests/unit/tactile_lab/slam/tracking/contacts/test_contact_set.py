"""Contacts as arrays: projection, frames, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from drivers.core.contacts import Contact, Grasp
from drivers.core.errors import TrackingError
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet, placement_sigma_m, planar_rotation
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR


def contact(point: list[float], normal: list[float], finger: str = "FF") -> Contact:
    return Contact(finger, np.array(point), np.array(normal), np.diag([1e-6, 4e-6, 9e-6]), 0.1, 0.5)


def grasp(*contacts: Contact) -> Grasp:
    return Grasp(3, 0, contacts, Pose3())


def test_heights_count_from_the_object_origin() -> None:
    seen = ContactSet.of_grasp(grasp(contact([0.01, 0.02, 0.03], [1, 0, 0])), 3, 0.022)
    assert np.allclose(seen.points_m, [[0.01, 0.02, 0.008]])


def test_the_point_s_deviation_is_the_one_along_its_normal() -> None:
    seen = ContactSet.of_grasp(grasp(contact([0, 0, 0], [1, 0, 0]), contact([0, 0.1, 0], [0, 1, 0], "MF")), 2, 0.0)
    assert np.allclose(seen.point_sigma_m, [1e-3, 2e-3])


def test_a_tilted_normal_is_laid_into_the_plane_with_more_uncertainty() -> None:
    seen = ContactSet.of_grasp(grasp(contact([0, 0, 0], [0.8, 0, 0.6])), 2, 0.0)
    assert np.allclose(seen.normals, [[1.0, 0.0]])
    assert seen.normal_sigma_rad[0] == pytest.approx(0.1 / 0.8)


def test_contacts_on_top_of_the_object_say_nothing_about_its_contour() -> None:
    assert len(ContactSet.of_grasp(grasp(contact([0, 0, 0], [0.1, 0, 0.99])), 2, 0.0)) == 0


def test_a_grasp_without_contacts_is_an_empty_set() -> None:
    assert len(ContactSet.of_grasp(grasp(), 2, 0.0)) == 0
    assert ContactSet.of_grasp(grasp(), 3, 0.0).points_m.shape == (0, 3)


def test_the_object_frame_turns_points_and_normals_but_not_heights() -> None:
    world = ContactSet.of_grasp(grasp(contact([0.1, 0.2, 0.05], [0, 1, 0])), 3, 0.0)
    seen = world.in_object_frame(np.array([0.1, 0.1, np.pi / 2]))
    assert np.allclose(seen.points_m, [[0.1, 0.0, 0.05]])
    assert np.allclose(seen.normals, [[1.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (grasp(contact([np.nan, 0, 0], [1, 0, 0])), "NaN or infinite"),
        (grasp(contact([0, 0, 0], [np.inf, 0, 0])), "NaN or infinite"),
        (grasp(contact([0, 0, 0], [0, 0, 0])), "no length"),
        (grasp(contact([0, 0, 0], [1, 0, 0]), contact([60.0, 0, 0], [-1, 0, 0], "TH")), "millimetres"),
        (
            replace(grasp(), hand_motion_world=Pose3(Rot3(), np.array([0, np.nan, 0]))),
            "hand's motion has NaN or infinite",
        ),
        (grasp(contact([1e6, 0, 0], [1, 0, 0])), "1e\\+06 m from the world's origin"),
    ],
)
def test_unusable_contacts_are_refused_and_the_grasp_is_named(bad: Grasp, words: str) -> None:
    with pytest.raises(TrackingError, match=words) as caught:
        ContactSet.of_grasp(bad, 2, 0.0)
    assert "grasp 3" in str(caught.value)


def test_no_contact_counts_as_known_exactly() -> None:
    exact = replace(contact([0, 0, 0], [1, 0, 0]), point_covariance_m2=np.zeros((3, 3)))
    seen = ContactSet.of_grasp(grasp(exact), 2, 0.0)
    assert 0 < seen.point_sigma_m[0] <= 1e-6


def test_a_rotation_in_the_plane_turns_counter_clockwise() -> None:
    assert np.allclose(planar_rotation(np.pi / 2) @ [1.0, 0.0], [0.0, 1.0])
    assert np.allclose(planar_rotation(0.3), Rot3.Rz(0.3).matrix()[:2, :2])


def test_an_uncertain_pose_moves_contacts_along_their_normals_only() -> None:
    """A shift along x moves the contact that faces x, a turn the one whose normal its lever crosses."""
    seen = ContactSet.of_grasp(grasp(contact([0, 0, 0], [1, 0, 0]), contact([0.1, 0, 0], [0, 1, 0], "MF")), 2, 0.0)
    row = np.zeros(3)
    shifted = placement_sigma_m(seen, row, np.diag([4e-6, 0.0, 0.0]), PLANAR)
    assert shifted == pytest.approx(0.002 / np.sqrt(2))
    turned = placement_sigma_m(seen, row, np.diag([0.0, 0.0, 1e-4]), PLANAR)
    assert turned == pytest.approx(0.1 * 0.01 / np.sqrt(2))
