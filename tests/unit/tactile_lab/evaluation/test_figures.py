"""Each error metric in its unit, on estimates whose error is known exactly."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from gtsam import Pose3, Rot3

from tactile_lab.evaluation.estimate_with_truth import Truth
from tactile_lab.evaluation.figures import (
    FIGURES,
    LoopFigures,
    SensingFigures,
    ShapeFigures,
    TimeFigures,
    TruthFigures,
    UncertaintyFigures,
    computed,
)
from tactile_lab.slam.shape.metrics.metrics import ShapeErrors
from tests.support.shape_examples import rectangle

AWAY = Pose3(Rot3.Rz(0.4), np.array([0.4, 0.1, 0.03]))
ERRORS = ShapeErrors(0.004, 0.001, 0.003, 0.002, 0.005, 0.7, 0.8, 0.9)
BEST = ShapeErrors(0.003, 0.001, 0.001, 0.001, 0.002, 0.9, 0.95, 0.97)


def figure(name: str, **parts: Any) -> Any:
    """A metric of an estimate that has just these parts."""
    return FIGURES[name](SimpleNamespace(**parts))  # type: ignore[arg-type]


def results(**parts: Any) -> SimpleNamespace:
    return SimpleNamespace(**parts)


def test_errors_of_a_shape_are_millimetres_and_shares() -> None:
    compared = SimpleNamespace(first_grasp=ERRORS, best_fit=BEST)
    assert figure("shape", shape=(compared, ())) == ShapeFigures(4.0, 2.0, 5.0, 0.7, 0.8, 0.9)
    assert figure("shape_best_fit", shape=(compared, ())) == ShapeFigures(3.0, 1.0, 2.0, 0.9, 0.95, 0.97)
    unknown = SimpleNamespace(first_grasp=None, best_fit=BEST)
    assert figure("shape", shape=(unknown, ())) is None
    assert figure("shape", shape=(None, ())) is figure("shape_best_fit", shape=(None, ())) is None


def test_sigma_is_told_in_millimetres_with_the_part_that_a_finger_shares() -> None:
    quantiles_m = np.linspace(0.0, 0.002, 101)
    for slam, shared_mm in (({"shared_sigma_m": 0.0004}, pytest.approx(0.4)), ({}, None)):
        found = figure("uncertainty", results=results(sigma_quantiles_m=quantiles_m, slam=slam))
        assert found == UncertaintyFigures(pytest.approx(1.0), pytest.approx(1.9), shared_mm)
    assert figure("uncertainty", results=results(sigma_quantiles_m=None, slam={})) is None


@pytest.mark.parametrize("known", ["mesh", "outline", "nothing"])
def test_contacts_are_judged_by_their_distance_from_the_true_surface_at_the_true_pose(known: str) -> None:
    beside_m = 0.05 + np.linspace(0.0, 0.002, 21)
    seen = np.column_stack([beside_m, np.zeros((21, 2))])
    placed = [AWAY.transformFrom(point) for point in seen]
    contacts = [SimpleNamespace(points_world_m=np.array(placed)), SimpleNamespace(points_world_m=np.ones((3, 3)))]
    truth = Truth(
        (AWAY, None),
        trimesh.creation.box((0.10, 0.06, 0.04)) if known == "mesh" else None,
        rectangle(0.10, 0.06) if known == "outline" else None,
    )
    found = figure("sensing", results=results(contacts=contacts), truth=truth)
    expected = SensingFigures(pytest.approx(1.0), pytest.approx(1.9))
    assert found == (None if known == "nothing" else expected)


def test_nothing_is_said_of_the_sensing_where_no_grasp_was_seen() -> None:
    contacts = [SimpleNamespace(points_world_m=np.ones((3, 3)))]
    truth = Truth((None,), outline_m=rectangle())
    assert figure("sensing", results=results(contacts=contacts), truth=truth) is None


@pytest.mark.parametrize(
    ("status", "error_mm", "failed"),
    [
        ("complete", 5.0, False),
        ("complete", 5.1, True),
        ("partial", None, None),
        ("lost", 0.1, True),
        ("lost", None, True),
    ],
)
def test_a_run_has_failed_if_it_is_lost_or_more_than_five_millimetres_off(
    status: str, error_mm: float | None, failed: bool | None
) -> None:
    assert figure("failed", results=results(status=status), registration_rms_mm=error_mm) is failed


def test_loops_are_counted_and_the_accepted_judged() -> None:
    nowhere = np.eye(3).tolist()
    loops = [
        {"earlier": 0, "later": 1, "accepted": True, "earlier_T_later": nowhere},
        {"earlier": 0, "later": 2, "accepted": True, "earlier_T_later": nowhere},
        {"earlier": 1, "later": 2, "accepted": False, "earlier_T_later": nowhere},
    ]
    moved = AWAY * Pose3(Rot3(), np.array([0.02, 0.0, 0.0]))
    poses = (AWAY, AWAY, moved)
    found = figure("loops", results=results(slam={"loops": loops}), poses=poses, truth=Truth(poses))
    assert found == LoopFigures(3, 2, 1)


def test_time_is_told_in_seconds_in_all_and_milliseconds_a_step() -> None:
    steps_s = np.linspace(0.0, 0.2, 21).tolist()
    found = figure("time", results=results(step_seconds=steps_s))
    assert found == TimeFigures(pytest.approx(2.1), pytest.approx(100.0), pytest.approx(190.0))
    assert figure("time", results=results(step_seconds=())) == TimeFigures(None, None, None)


@pytest.mark.parametrize(
    ("truth", "known"),
    [
        (Truth((AWAY, None, None)), False),
        (Truth((AWAY, None, None), trimesh.creation.box((1, 1, 1))), True),
        (Truth((AWAY, None, None), outline_m=rectangle()), True),
    ],
)
def test_it_says_how_much_of_the_truth_is_known(truth: Truth, known: bool) -> None:
    assert figure("truth", truth=truth, poses=(AWAY,) * 3) == TruthFigures(1, 2, known)


@pytest.mark.parametrize(
    ("value", "kept"),
    [
        (np.array([1.0, np.nan]), False),
        (np.float64(np.inf), False),
        ({"a": (1.0, float("nan"))}, False),
        ([1, "word", None], True),
        (np.array([1.0, 2.0]), True),
        (float("inf"), False),
    ],
)
def test_a_metric_that_is_not_finite_is_null_and_said_so(
    monkeypatch: pytest.MonkeyPatch, value: Any, kept: bool
) -> None:
    monkeypatch.setattr("tactile_lab.evaluation.figures.FIGURES", own := type(FIGURES)("evaluation figure"))
    own.register("roughness", lambda estimate: value)
    values, warnings = computed(SimpleNamespace())  # type: ignore[arg-type]
    assert (values["roughness"] is value) is kept
    assert len(warnings) == (not kept)
    assert all("roughness" in warning and "is not a finite number" in warning for warning in warnings)
