"""Poses and flat faces smoothed together, and what faces say about contacts that do not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from tactile_lab.experiments.data import planar_data
from tactile_lab.experiments.run_metrics import slam_figures
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother, smoothed_with_faces
from tactile_lab.slam.tracking.faces.faceted_scorer import FacetedScorer
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces, flat_faces
from tactile_lab.slam.tracking.joint.hypotheses import HypothesisScorer
from tests.support.simulated_contacts import true_map

NOISE = MotionNoise()


def shaken(contact_map: ContactMap, scale: float) -> Array:
    shake = np.random.default_rng(0).normal(size=contact_map.rows.shape) * [0.002, 0.002, 0.03] * scale
    shake[0] = 0.0
    return np.asarray(contact_map.rows + shake)


@pytest.mark.parametrize(("shape", "dimension"), [("rectangle", 2), ("L", 2), ("box-12x6x6", 3)])
def test_shaken_poses_settle_on_the_faces_to_within_the_noise(shape: str, dimension: int) -> None:
    contact_map = true_map(shape, dimension=dimension)
    smoother, faces = FacetSmoother(contact_map, NOISE), flat_faces(contact_map)[0]
    start = smoother.fit(shaken(contact_map, 4.0), faces, 0)
    found = smoother.fit(start.rows, faces, 20)
    observed = len(contact_map.contacts) * dimension
    assert start.chi_square > 5 * observed
    assert found.chi_square < 1.3 * observed


def test_a_rectangle_has_four_faces_at_right_angles() -> None:
    contact_map = true_map("rectangle", count=16)
    found = smoothed_with_faces(contact_map.with_rows(shaken(contact_map, 0.4)), NOISE)
    assert found is not None
    assert found.faces.count == 4
    products = np.abs(found.faces.normals @ found.faces.normals.T)
    assert np.all((products < 0.1) | (products > 0.99))


def test_smoothing_never_raises_the_cost_and_keeps_the_first_pose() -> None:
    contact_map = true_map("hexagon")
    smoother, rows = FacetSmoother(contact_map, NOISE), shaken(contact_map, 1.0)
    angles = np.arctan2(*contact_map.contacts.normals.T[::-1])
    labels = np.digitize(angles, np.linspace(-np.pi, np.pi, 7)[1:-1])
    normals = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(-np.pi, np.pi, 13)[1::2]])
    none = np.zeros(len(labels), dtype=bool)
    faces = FlatFaces(labels, normals, np.full(6, 0.035), none, none)
    few, many = smoother.fit(rows, faces, 1), smoother.fit(rows, faces, 10)
    assert many.cost <= few.cost
    assert np.array_equal(many.rows[0], rows[0])


def test_merged_faces_hold_the_contacts_of_both() -> None:
    normals, none = np.eye(3)[:, :2] + [[0, 0], [0, 0], [1, 0]], np.zeros(5, dtype=bool)
    faces = FlatFaces(np.array([0, 1, 2, 2, 1]), normals, np.arange(3.0), none, none)
    merged = faces.merge(0, 1)
    assert merged.labels.tolist() == [0, 0, 1, 1, 0]
    assert merged.offsets_m.tolist() == [pytest.approx(2 / 3), 2.0]
    assert np.linalg.norm(merged.normals[0]) == pytest.approx(1.0)


def sharp_judge(contact_map: ContactMap) -> FacetedScorer:
    return FacetedScorer(HypothesisScorer(NOISE, 5.0), NOISE)


@pytest.mark.parametrize("shape", ["ellipse", "trapezoid", "stadium"])
def test_wrong_contacts_are_left_out_and_hardly_any_right_one(shape: str) -> None:
    data = planar_data.simulate(shape, 4, count=14, outlier_share=0.1)
    slam = TactileSlam(SlamSettings(method="known-pose"), 0, known_poses=data.world_T_body)
    wrong = used = 0
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        used += slam.add_grasp(grasp).contacts_used
        bodies = np.array([pose.transformTo(contact.point_world_m)[:2] for contact in grasp.contacts])
        wrong += int(np.sum(distances_to_polygon(bodies, data.outline_m) > 0.005))
    left_out = sum(len(grasp.contacts) for grasp in data.grasps) - used
    assert wrong >= 2
    assert wrong <= left_out <= wrong + 9


@pytest.mark.long  # quicker: wrong contacts are left out
def test_one_wrong_contact_does_not_hide_all_faces() -> None:
    data = planar_data.simulate("L", 7, outlier_share=0.1)  # 23 mm off, where the smooth field lets it pass
    slam = TactileSlam(SlamSettings(method="known-pose"), 0, known_poses=data.world_T_body)
    for grasp in data.grasps:
        slam.add_grasp(grasp)
    assert slam_figures(data, slam.finish())["hausdorff_mm"] < 2


def test_contacts_left_out_by_mistake_come_back() -> None:
    contact_map = true_map("rectangle", count=14)
    thinner = contact_map.without_contact(1, 2).without_contact(4, 1)
    assert thinner.left_out_count == 2
    assert sharp_judge(thinner).better(thinner).map.left_out_count == 0


def test_only_the_last_way_to_a_contact_that_is_left_out_is_no_evidence() -> None:
    """The contact may be wrong by more than a centimetre; farther back its finger was on its way all the same."""
    grasp = true_map("rectangle", count=3).placed[1]
    world = grasp.contacts_world
    assert len(grasp.free_world_m) == len(world.free_m) > 0
    fewer = replace(grasp, left_out=frozenset({0}))
    before = world.free_m[world.free_of == 0]
    away_m = np.linalg.norm(before - world.points_m[0], axis=1)
    kept = [bool((np.abs(fewer.free_world_m - place).max(axis=1) < 1e-12).any()) for place in before]
    assert kept == (away_m > 0.018).tolist() == [False, False, True, True]
