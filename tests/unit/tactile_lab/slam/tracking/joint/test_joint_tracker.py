"""What the joint tracker takes over from outside, and what it tells between grasps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise, planar_motion
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.joint.settings import JointSettings
from tests.support.simulated_contacts import true_map


def tracked(window: int, count: int = 5) -> JointTracker:
    known = true_map("ellipse", count=count)
    settings = JointSettings(window=window, hypotheses=1, smoothed=1, iterations=2)
    tracker = JointTracker(replace(known, placed=known.placed[:1]), MotionNoise(), settings, kernel_every=10)
    for grasp in known.placed[1:]:
        tracker.predict(grasp.motion)
        tracker.weigh(grasp.contacts_world)
        tracker.update_shape(grasp.contacts_world, certain=True)
        tracker.resample()
    return tracker


def test_other_kernel_parameters_are_taken_over() -> None:
    tracker = tracked(window=12)
    tracker.adopt(tracker.map.with_best_kernel())
    assert tracker.map.settings != true_map("ellipse", count=1).settings


def drifting_box(seed: int, count: int = 8) -> tuple[JointTracker, Array]:
    """A tracker in the middle of a session with a rectangle, and the true poses in its frame."""
    data = simulate("rectangle", seed, count=count)
    rows = np.array([planar_motion(pose) for pose in data.world_T_body])
    contacts = [ContactSet.of_grasp(grasp, 2, 0.0) for grasp in data.grasps]
    motions = [planar_motion(grasp.hand_motion_world) for grasp in data.grasps]
    first = ContactMap((PlacedGrasp(contacts[0], rows[0], 1e-10 * np.eye(3), motions[0]),), GpisSettings())
    tracker = JointTracker(first, MotionNoise(), JointSettings(), kernel_every=4)
    for seen, motion in zip(contacts[1:], motions[1:], strict=True):
        tracker.predict(motion)
        tracker.weigh(seen)
        tracker.update_shape(seen, certain=True)
        tracker.resample()
    return tracker, rows


def rms_away_m(contact_map: ContactMap, true_rows: Array) -> float:
    truth = contact_map.with_rows(true_rows).contacts.points_m
    return float(np.sqrt(np.mean(np.sum((contact_map.contacts.points_m - truth) ** 2, axis=1))))


def test_what_is_told_between_grasps_is_smoothed_with_the_faces_of_the_object() -> None:
    """Over several sessions, because a single one may be lucky without."""
    found = [drifting_box(seed) for seed in (50, 51, 52)]
    told = [rms_away_m(tracker.refined, rows) for tracker, rows in found]
    on_the_way = [rms_away_m(tracker.map, rows) for tracker, rows in found]
    assert np.mean(told) < 0.8 * np.mean(on_the_way)


def test_telling_changes_nothing_that_is_followed() -> None:
    tracker, _ = drifting_box(50, count=4)
    before = [one.map for one in tracker.hypotheses]
    assert tracker.refined is tracker.refined
    assert all(one.map is known for one, known in zip(tracker.hypotheses, before, strict=True))


def test_the_end_is_told_as_it_is() -> None:
    tracker, _ = drifting_box(50, count=4)
    tracker.finish()
    assert tracker.refined is tracker.map
