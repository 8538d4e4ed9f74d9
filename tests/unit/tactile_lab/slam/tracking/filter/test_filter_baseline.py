"""Numbers of the thesis's filter, compared with those stored: any change of them is told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.filter.measurement import (
    CalibratedMeasurement,
    CalibratedSettings,
    GateSettings,
    Known,
    Measurement,
    ThesisMeasurement,
)
from tactile_lab.slam.tracking.filter.particle_filter import Belief
from tactile_lab.slam.tracking.trackers import TrackingSettings, make_tracker
from tests.support.baseline import assert_baseline
from tests.support.baseline_problems import Kind, any_rows, felt, kernel, session, true_placed
from tests.support.digest import digest

MEASUREMENTS: dict[str, Measurement] = {
    "calibrated": CalibratedMeasurement(CalibratedSettings()),
    "surface": ThesisMeasurement(GateSettings(), 0.005),
    "previous": ThesisMeasurement(GateSettings(close_to="previous", distance_m=0.03, least_contacts=2), 0.005),
    "earlier": ThesisMeasurement(GateSettings(close_to="earlier", distance_m=0.015, least_eigenvalue=0.4), 0.004),
    "hardly a gate": ThesisMeasurement(GateSettings(least_contacts=1, least_eigenvalue=1e-4), 0.005),
}


@pytest.mark.parametrize("kind", ["plane", "table"])
def test_likelihoods_of_particles(kind: Kind) -> None:
    """Forty poses around the true one, by each measurement model and each reading of the gate."""
    known = true_placed(session(kind), kind)
    before, last = replace(known, placed=known.placed[:4]), known.placed[4]
    rows = last.pose + 0.12 * any_rows("plane", 40) * np.linspace(0.0, 1.0, 40)[:, None] ** 2
    given = Known(before.fit(), before.contacts_of(3), before.contacts)
    values: dict[str, Any] = {}
    for name, measurement in MEASUREMENTS.items():
        found = measurement.log_likelihood(rows, last.contacts_world, given)
        values[name] = ["none" if each == -np.inf else float(each) for each in found[::3]] + digest(
            np.where(np.isfinite(found), found, -100.0)
        )
    assert_baseline(f"tracking/filter/likelihoods-{kind}", values)


def test_a_belief() -> None:
    """Particles on both sides of half a turn: moved, weighted, averaged and drawn again."""
    rng = np.random.default_rng(2)
    rows = any_rows("plane", 50) + np.array([0.0, 0.0, 2.6])
    belief = Belief(rows, np.full(50, 0.02)).predict(np.array([0.01, -0.02, 0.4]), MotionNoise(), rng)
    weighted = belief.weight(-0.5 * np.linspace(0.0, 5.0, 50) ** 2)
    assert weighted is not None
    unlikely = belief.weight(-900.0 - 0.5 * np.linspace(0.0, 5.0, 50) ** 2)  # its exponential is zero
    assert unlikely is not None
    assert np.allclose(unlikely.weights, weighted.weights, atol=1e-12)
    found, again = weighted.estimate(), weighted.resample(rng)
    values = {
        "rows": digest(belief.rows),
        "weights": digest(weighted.weights),
        "mean": found.pose,
        "covariance": found.covariance,
        "count": [weighted.effective_count, again.effective_count],
        "drawn again": digest(again.rows),
        "kept": weighted.resample(rng).rows.shape,
    }
    assert_baseline("tracking/filter/belief", values)


@pytest.mark.parametrize(
    ("method", "changes"),
    [
        ("particle", {}),
        ("thesis-pf", {}),
        ("thesis-pf", {"matching": "previous", "gate": {"close_to": "previous", "distance_m": 0.03}}),
    ],
    ids=["particle", "thesis", "previous"],
)
def test_the_filter_follows_a_rectangle(method: str, changes: dict[str, Any], request: pytest.FixtureRequest) -> None:
    """Five grasps with a step that the fingertips felt: the pose and its covariance after each, and the kernel."""
    data = felt(session("plane"), 3)
    first = true_placed(data, "plane").placed[0]
    given = {"method": method, "particles": 400, "motion": {"translation_m": 0.005, "rotation_rad": 0.1}, **changes}
    settings = TrackingSettings.model_validate(given)
    tracker = make_tracker(settings, first, np.random.default_rng(6))
    steps = []
    for grasp in true_placed(data, "plane").placed[1:]:
        tracker.predict(grasp.motion, grasp.motion_sigma)
        certain = tracker.weigh(grasp.contacts_world)
        found = tracker.estimate()
        tracker.update_shape(grasp.contacts_world, certain)
        steps.append([certain, tracker.effective_count, found.pose, digest(found.covariance)])
        tracker.resample()
    tracker.adopt(tracker.map.with_rows(tracker.map.rows + np.array([0.001, 0.002, 0.1])))
    values = {
        "steps": steps,
        "kernel": kernel(tracker.map),
        "used": [one.used for one in tracker.map.placed],
        "adopted": tracker.estimate().pose,
    }
    name = request.node.callspec.id
    assert_baseline(f"tracking/filter/followed-{name}", values, rtol=1e-3, atol=1e-6)


def test_particles_look_the_field_up_in_a_grid() -> None:
    """How far the grid reaches beyond the contacts, and what it holds."""
    known = true_placed(session("plane", count=3), "plane")
    grid = FieldGrid.around(known.fit(), margin_m=0.04, spacing_m=0.006, gradient=True, variance=True)
    found = grid.predict(known.contacts.points_m * 1.2, gradient=True, variance=True)
    assert found.gradient is not None
    values = {"mean": found.mean_m, "gradient": found.gradient, "variance": digest(found.variance_m2)}
    assert_baseline("tracking/filter/grid", values)
