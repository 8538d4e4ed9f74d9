"""Candidate grasps: expected contacts, reward (4.20) and the explored share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import (
    Candidate,
    ClosingRays,
    ModelledObject,
    PredictedContacts,
    predict_contacts,
    ring_of_candidates,
)
from tactile_lab.slam.exploration.rewards import explored_share, rate, variance_reward
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.posterior import Prediction
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

RADIUS_m = 0.030


class Disc:
    """A disc or sphere whose variance grows along x."""

    def predict(self, points_m: Array, *, gradient: bool = False, variance: bool = False) -> Prediction:
        radii = np.linalg.norm(points_m, axis=1)
        return Prediction(
            radii - RADIUS_m, points_m / np.maximum(radii, 1e-9)[:, None], 1e-6 * np.exp(points_m[:, 0] / RADIUS_m)
        )


def rays(*angles_rad: float, height_m: float = 0.02, length_m: float = 0.1) -> ClosingRays:
    """Rays toward the origin from 100 mm around it."""
    inward = -np.column_stack([np.cos(angles_rad), np.sin(angles_rad), np.zeros(len(angles_rad))])
    names = ("FF", "MF", "RF", "LF", "TH")[: len(angles_rad)]
    starts = -0.1 * inward + np.array([0.0, 0.0, height_m])
    return ClosingRays(names, starts, inward, np.full(len(names), length_m))


def known(dimension: int = 2, pose: Pose2 | None = None, height_m: float = 0.0) -> ModelledObject:
    return ModelledObject(Disc(), dimension, pose or Pose2(), height_m)


def test_rays_touch_where_they_first_meet_the_surface() -> None:
    found = predict_contacts(Candidate(Pose2(), "radial", rays(0.0, 2.0)), known())
    assert found.fingers == ("FF", "MF")
    assert np.allclose(found.points_object_m, RADIUS_m * np.array([[1, 0], [np.cos(2), np.sin(2)]]), atol=1e-5)


def test_a_round_fingertip_touches_beside_its_way_what_it_meets_at_an_angle() -> None:
    """A ball that passes a disc 24 mm beside its middle, at rest when the centres are both radii apart."""
    aside_m = 0.024
    ball = rays(0.0)
    starts = ball.starts_m + np.array([0.0, aside_m, 0.0])
    thick = ClosingRays(("FF",), starts, ball.directions, ball.lengths_m, radius_m=0.008)
    found = predict_contacts(Candidate(Pose2(), "pinch", thick), known())
    rest = np.array([np.sqrt((RADIUS_m + 0.008) ** 2 - aside_m**2), aside_m])
    assert np.allclose(found.points_object_m, RADIUS_m * rest / np.linalg.norm(rest), atol=2e-5)
    assert found.points_object_m[0, 1] < aside_m - 0.004
    passing = replace(thick, starts_m=ball.starts_m + np.array([0.0, RADIUS_m + 0.007, 0.0]))
    assert predict_contacts(Candidate(Pose2(), "pinch", passing), known()).fingers == ("FF",)
    assert predict_contacts(Candidate(Pose2(), "pinch", replace(passing, radius_m=0.006)), known()).fingers == ()


def test_rays_that_pass_by_or_end_early_touch_nothing() -> None:
    aside = rays(0.0)
    aside = ClosingRays(("FF",), aside.starts_m + np.array([0.0, 0.04, 0.0]), aside.directions, aside.lengths_m)
    assert predict_contacts(Candidate(Pose2(), "pinch", aside), known()).fingers == ()
    short = predict_contacts(Candidate(Pose2(), "pinch", rays(0.0, length_m=0.05)), known())
    assert short.fingers == ()
    assert variance_reward(short) == 0.0


def test_contacts_follow_object_and_grasp_frames() -> None:
    pose = Pose2(0.3, -0.1, 1.2)
    found = predict_contacts(Candidate(pose.compose(Pose2(0.0, 0.0, 0.5)), "radial", rays(0.0)), known(pose=pose))
    assert np.allclose(found.points_object_m, RADIUS_m * np.array([[np.cos(0.5), np.sin(0.5)]]), atol=1e-5)


def test_in_space_heights_count_from_the_object_origin() -> None:
    found = predict_contacts(Candidate(Pose2(), "radial", rays(0.0, height_m=0.04)), known(3, height_m=0.022))
    expected = [np.sqrt(RADIUS_m**2 - 0.018**2), 0.0, 0.018]
    assert np.allclose(found.points_object_m, [expected], atol=1e-4)


def test_the_reward_is_the_sum_of_variances() -> None:
    contacts = PredictedContacts(("FF", "TH"), np.zeros((2, 2)), np.array([2e-6, 3e-6]))
    assert variance_reward(contacts) == pytest.approx(5e-6)


def test_candidates_that_touch_uncertain_places_come_first() -> None:
    sure = Candidate(Pose2(), "pinch", rays(np.pi))
    unsure = Candidate(Pose2(), "radial", rays(0.0))
    rated = rate([sure, unsure], known())
    assert [item.candidate for item in rated] == [unsure, sure]
    assert rated[0].reward_m2 == pytest.approx(1e-6 * np.e, rel=1e-3)


def test_a_ring_holds_every_combination_around_its_centre() -> None:
    ring = ring_of_candidates(
        np.array([0.1, 0.2]),
        np.array([0.0, np.pi / 2]),
        np.array([-0.02, 0.02]),
        {"pinch": rays(0.0), "radial": rays(1.0)},
    )
    assert len(ring) == 8
    turned = [candidate.world_T_grasp for candidate in ring if candidate.world_T_grasp.theta() > 1.0]
    assert sorted({round(pose.x(), 6) for pose in turned}) == [0.08, 0.12]
    assert {candidate.closing for candidate in ring} == {"pinch", "radial"}


def test_a_grid_predicts_contacts_like_the_field() -> None:
    angles = np.linspace(0, 2 * np.pi, 9)[:-1]
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    gpis = Gpis.fit(RADIUS_m * normals, normals)
    candidate = Candidate(Pose2(), "radial", rays(0.3, 1.8, 4.0))
    exact = predict_contacts(candidate, ModelledObject(gpis, 2, Pose2(), 0.0))
    gridded = predict_contacts(candidate, ModelledObject(FieldGrid.around(gpis), 2, Pose2(), 0.0))
    assert np.allclose(exact.points_object_m, gridded.points_object_m, atol=5e-4)


def test_explored_share_of_a_contour_is_a_share_of_its_length() -> None:
    points = np.array([[0.0, 0.0], [0.03, 0.0], [0.03, 0.01], [0.0, 0.01]])
    contour = Contour(points, np.array([0.001, 0.001, 0.009, 0.009]), is_closed=True)
    assert explored_share(contour, 0.003) == pytest.approx(0.03 / 0.08)
    assert explored_share(contour, 0.0055) == pytest.approx(0.05 / 0.08)
    assert explored_share(contour, 0.01) == pytest.approx(1.0)


def test_explored_share_of_a_mesh_is_a_share_of_its_area() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [3, 0, 0]]) / 100
    faces = np.array([[0, 1, 2], [1, 3, 2]])
    mesh = SurfaceMesh(vertices, faces, np.array([0.001, 0.002, 0.002, 0.02]), np.tile([0.0, 0.0, 1.0], (4, 1)), False)
    assert explored_share(mesh) == pytest.approx(1 / 3)
