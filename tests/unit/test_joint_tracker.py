"""What the joint tracker takes over from outside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tactile_lab.tracking.joint_settings import JointSettings
from tactile_lab.tracking.joint_tracker import JointTracker
from tactile_lab.tracking.motion import MotionNoise
from tests.support.simulated_contacts import true_map

SHIFT = np.array([0.001, 0.0, 0.0])


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


def test_poses_that_were_smoothed_together_are_not_moved_by_loops_between_them() -> None:
    tracker = tracked(window=12)
    before = tracker.map
    tracker.adopt(before.with_rows(before.rows + SHIFT))
    assert np.array_equal(tracker.map.rows, before.rows)


def test_other_kernel_parameters_are_taken_over() -> None:
    tracker = tracked(window=12)
    tracker.adopt(tracker.map.with_best_kernel())
    assert tracker.map.settings != true_map("ellipse", count=1).settings


def test_a_session_with_settled_grasps_is_corrected_by_loops() -> None:
    tracker = tracked(window=2)
    moved = tracker.map.rows + SHIFT
    tracker.adopt(tracker.map.with_rows(moved))
    assert np.allclose(tracker.map.rows, moved)
