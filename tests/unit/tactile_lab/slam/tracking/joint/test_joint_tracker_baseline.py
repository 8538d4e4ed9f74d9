"""Numbers of whole small sessions of method "joint", compared with those stored: any change of them is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tactile_lab.experiments.data.sensing import SimulatedGrasps
from tactile_lab.slam.graph.relocation import relocated_poses
from tactile_lab.slam.tracking.joint.joint_tracker import JointTracker
from tactile_lab.slam.tracking.trackers import TrackingSettings, make_tracker
from tests.support.baseline import assert_baseline
from tests.support.baseline_problems import Kind, felt, session, thrown, told, true_placed, unheld
from tests.support.digest import digest

MOTION = {"translation_m": 0.006, "rotation_rad": 0.15, "unheld": 0.15, "palm_m": 0.0005}
CLOSE = {"rtol": 1e-3, "atol": 1e-5}
"""An optimiser that stops when little is gained ends a little elsewhere on each processor."""

QUICK = {"proposals": {"samples": 32}, "hypotheses": 2, "smoothed": 3}


def tracked(kind: Kind, data: SimulatedGrasps, **changes: Any) -> tuple[JointTracker, list[Any]]:
    """The tracker after a session, and what it said at each grasp."""
    given = {
        "dimension": 2 if kind == "plane" else 3,
        "freedom": "space" if kind == "space" else "table",
        "motion": MOTION,
        "joint": QUICK,
        "kernel_every": 2,
        **changes,
    }
    known = true_placed(data, kind, off=0.0)
    relocate = None if kind == "space" else relocated_poses
    tracker = make_tracker(
        TrackingSettings.model_validate(given), known.placed[0], np.random.default_rng(0), relocate=relocate
    )
    assert isinstance(tracker, JointTracker)
    said = []
    for grasp in known.placed[1:]:
        tracker.predict(grasp.motion, grasp.motion_sigma)
        explained = tracker.weigh(grasp.contacts_world)
        found = tracker.estimate()
        tracker.update_shape(grasp.contacts_world, explained)
        tracker.resample()
        settings = [[one.map.settings.amplitude_m, one.map.settings.length_m] for one in tracker.hypotheses]
        costs = [one.cost for one in tracker.hypotheses]
        spreads = [digest(found.covariance), digest(tracker.estimate().covariance)]
        said.append([explained, tracker.effective_count, found.pose, spreads, costs, settings])
        assert len(tracker.map.placed) > 2 or tracker.refined is tracker.map
        assert len(tracker.common_covariances) == 0
    return tracker, said


def ended(tracker: JointTracker) -> dict[str, Any]:
    """What a finished session tells."""
    tracker.finish()
    best = tracker.hypotheses[0]
    assert tracker.refined is tracker.map
    return {
        "best": told(best),
        "costs": [one.cost for one in tracker.hypotheses],
        "rivals": [one.cost for one in tracker.rivals],
        "contenders": [np.linalg.norm(one.map.rows) for one in tracker.contenders],
        "covariances": digest([one.covariance for one in best.map.placed]),
        "common": digest(tracker.common_covariances),
        "acted": sorted(tracker.mechanisms.changed),
    }


def test_a_rectangle_that_was_thrown() -> None:
    """In the plane, relocated before the fourth grasp, finished: read backwards, spliced, with faces and rivals."""
    tracker, said = tracked("plane", thrown(session("plane", count=5), 3))
    refined = tracker.refined.rows
    assert_baseline(
        "tracking/sessions/thrown", {"said": said, "refined": refined, **ended(tracker)}, rtol=1e-4, atol=1e-6
    )


def test_a_rectangle_between_grasps() -> None:
    """In the plane, with all settings as they are: what is shown before the end, with flat faces."""
    tracker, said = tracked("plane", session("plane", count=6, seed=1), joint={}, kernel_every=4)
    values = {"said": said, "best": told(tracker.hypotheses[0]), "refined": tracker.refined.rows}
    assert np.abs(values["refined"] - tracker.map.rows).max() > 1e-3
    assert_baseline("tracking/sessions/between-grasps", values, **CLOSE)


def test_a_pentagon_with_wrong_contacts() -> None:
    """In the plane, a third of the contacts wrong, the motion's noise learnt, early grasps settled, not finished."""
    data = session("plane", "pentagon", count=8, seed=5, wrong=0.3)
    tracker, said = tracked(
        "plane", data, joint={**QUICK, "estimate_motion": True, "window": 2, "remembered": 10}, kernel_every=3
    )
    values = {"said": said, "best": told(tracker.hypotheses[0]), "acted": sorted(tracker.mechanisms.changed)}
    assert_baseline("tracking/sessions/wrong-contacts", values, **CLOSE)


def test_an_ellipse_left_in_place_and_felt() -> None:
    """In the plane, a step with the object left in place and pushed, a felt one, and without free space; finished
    without most second opinions.
    """
    data = felt(unheld(session("plane", "ellipse", count=5, seed=2), 2), 3)
    without = ["free space", "splicing", "placing on the object", "relocation", "valleys"]
    tracker, said = tracked("plane", data, joint={**QUICK, "without": without, "final_iterations": 5})
    assert_baseline("tracking/sessions/left-in-place", {"said": said, **ended(tracker)}, **CLOSE)


def test_a_block_on_the_table() -> None:
    """In space, with a step left in place, finished without reading backwards and without other places on the solid."""
    data = unheld(session("table", count=3), 2)
    without = ["placing on the object", "regular faces"]
    tracker, said = tracked(
        "table", data, joint={**QUICK, "backwards": False, "final_iterations": 10, "without": without}
    )
    assert_baseline("tracking/sessions/block", {"said": said, **ended(tracker)}, **CLOSE)


@pytest.mark.parametrize("shape", ["l-block", "sphere"])
def test_six_degrees_of_freedom(shape: str) -> None:
    """A block and a sphere held free in space, one step felt, not finished."""
    data = felt(session("space", shape, count=4), 2)
    tracker, said = tracked("space", data, joint={**QUICK, "window": 2})
    values = {"said": said, "best": told(tracker.hypotheses[0]), "refined": tracker.refined.rows}
    assert_baseline(f"tracking/sessions/free-{shape}", values, **CLOSE)
