"""Numbers of the trackers that methods are compared with, compared with those stored: any change of them is told."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.tracker import Tracker
from tactile_lab.slam.tracking.trackers import TrackingSettings, make_tracker
from tests.support.baseline import assert_baseline
from tests.support.baseline_problems import KINDS, Kind, felt, kernel, session, true_placed


def problem(kind: Kind) -> ContactMap:
    """Five grasps, a step of them felt by the fingertips, with a contact far off."""
    known = true_placed(felt(session(kind), 2), kind)
    last = known.placed[3]
    points = last.contacts_world.points_m.copy()
    points[0] += 0.013
    return known.with_placed(3, replace(last, contacts_world=replace(last.contacts_world, points_m=points)))


def tracked(kind: Kind, method: str, **changes: Any) -> tuple[Tracker, list[Any]]:
    """The tracker after these grasps, and what it said at each."""
    known = problem(kind)
    poses = [known.space.pose(row, 0.0) for row in known.rows]
    settings = TrackingSettings.model_validate(
        {
            "method": method,
            "dimension": 2 if kind == "plane" else 3,
            "freedom": "space" if kind == "space" else "table",
            "motion": {"translation_m": 0.006, "rotation_rad": 0.15},
            **changes,
        }
    )
    given = [*poses[:2], None, *poses[3:]] if method == "known-pose" else None
    tracker, said = make_tracker(settings, known.placed[0], np.random.default_rng(0), given), []
    for grasp in known.placed[1:]:
        tracker.predict(grasp.motion, grasp.motion_sigma)
        certain = tracker.weigh(grasp.contacts_world)
        found = tracker.estimate()
        tracker.update_shape(grasp.contacts_world, certain)
        tracker.resample()
        said.append([certain, found.pose, np.diag(found.covariance), found.covariance[0]])
    return tracker, said


@pytest.mark.parametrize(
    ("method", "kind"),
    [*product(["odometry", "icp"], KINDS), ("known-pose", "plane"), ("known-pose", "space")],
)
def test_what_a_tracker_says_at_each_grasp(method: str, kind: Kind) -> None:
    """Poses and covariances grasp by grasp, and the contacts and kernel of the map at the end."""
    tracker, said = tracked(kind, method)
    kernels = [kernel(tracker.map)]
    tracker.finish()
    values = {
        "said": said,
        "left out": [sorted(one.left_out) for one in tracker.map.placed],
        "kernels": [*kernels, kernel(tracker.map)],
        "effective": tracker.effective_count,
    }
    tracker.adopt(tracker.map.with_rows(tracker.map.space.move(tracker.map.rows, np.full_like(tracker.map.rows, 0.01))))
    values["adopted"] = tracker.estimate().pose
    assert_baseline(f"tracking/baselines/{method}-{kind}", values, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize(
    ("name", "icp"), [("near", {"reach_m": 0.006}), ("few", {"least_matched": 0.9}), ("doubted", {"believed": 0.4})]
)
def test_registration_may_be_refused(name: str, icp: dict[str, float]) -> None:
    """Few contacts with a partner, or a pose far from the motion: odometry is used."""
    _, said = tracked("plane", "icp", icp=icp)
    assert_baseline(f"tracking/baselines/icp-{name}", {"said": said}, rtol=1e-4, atol=1e-7)
