"""Faces that stand in for a round surface: how it turns at its contacts, and what it tells of a pose."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.experiments.data import spatial_data
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL
from tactile_lab.slam.tracking.faces.bends import Bends
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty
from tactile_lab.slam.tracking.joint.pose_covariance import PoseCovariances

NOISE = MotionNoise(translation_m=0.005, rotation_rad=float(np.deg2rad(10.0)))


def held_truly(shape: str, count: int = 16) -> ContactMap:
    """Grasps of a solid held free, at their true poses, the object frame being the body's."""
    data = spatial_data.simulate(shape, 3, motion="free", motion_scale=0.5, count=count)
    placed = [
        PlacedGrasp(
            ContactSet.of_grasp(grasp, 3, 0.0),
            SPATIAL.vector(pose),
            1e-6 * np.eye(6),
            SPATIAL.vector(grasp.hand_motion_world),
        )
        for grasp, pose in zip(data.grasps, data.world_T_body, strict=True)
    ]
    return ContactMap(tuple(placed), GpisSettings(), space=SPATIAL).with_best_kernel()


@pytest.fixture(scope="module")
def ball() -> ContactMap:
    return held_truly("sphere")


def median_turn_rad(joint: Array) -> float:
    """Median standard deviation of a grasp's rotation, of the joint covariance of all poses but the first."""
    return float(np.median(np.sqrt(np.diag(joint).reshape(-1, 6)[:, 3:])))


def test_the_normal_of_a_ball_turns_by_one_over_its_radius_along_it(ball: ContactMap) -> None:
    found, outward = Bends.of(ball), ball.contacts.points_m / np.linalg.norm(ball.contacts.points_m, axis=1)[:, None]
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0)
    assert np.median(np.sum(found.normals * outward, axis=1)) > 0.99
    radius_m = float(np.median(np.linalg.norm(ball.contacts.points_m, axis=1)))
    along = np.linalg.svd(outward[:, None])[2][:, 1:]
    curvature = np.einsum("nkd,nde,nke->nk", along, found.turning, along)
    assert np.median(curvature) == pytest.approx(1 / radius_m, rel=0.25)


def test_contacts_do_not_tell_how_a_ball_is_turned_and_flat_faces_in_its_place_seem_to(ball: ContactMap) -> None:
    bent = np.linalg.inv(FacetCertainty.of(ball, NOISE, Bends.of(ball)).information_of_poses)
    flat = np.linalg.inv(FacetCertainty.of(ball, NOISE).information_of_poses)
    assert median_turn_rad(flat) < 0.5 * NOISE.rotation_rad
    assert median_turn_rad(bent) > 1.5 * median_turn_rad(flat)


def test_covariances_of_a_ball_are_those_of_a_round_surface_and_of_a_box_those_of_its_faces(ball: ContactMap) -> None:
    box = held_truly("box-12x6x6")
    of_ball, of_box = (PoseCovariances.of(each, NOISE).birth[1:] for each in (ball, box))
    bent = np.linalg.inv(FacetCertainty.of(ball, NOISE, Bends.of(ball)).information_of_poses)
    flat = np.linalg.inv(FacetCertainty.of(box, NOISE).information_of_poses)
    for found, joint in ((of_ball, bent), (of_box, flat)):
        own = [joint[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] for i in range(len(found))]
        np.testing.assert_allclose(found, own, rtol=1e-6, atol=1e-12)
