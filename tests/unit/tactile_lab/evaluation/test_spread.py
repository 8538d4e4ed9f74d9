"""Spreads and confidence intervals, against tables and what follows from the numbers alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tactile_lab.evaluation.spread import Interval, Spread, quantile

INFINITE = math.inf


@pytest.mark.parametrize(
    ("values", "share", "expected"),
    [
        ([3.0], 0.9, 3.0),
        ([4.0, 1.0, 2.0, 3.0], 0.5, 2.5),
        ([4.0, 1.0, 2.0, 3.0, 5.0], 0.5, 3.0),
        ([0.0, 10.0], 0.9, 9.0),
        ([1.0, 2.0, INFINITE], 0.5, 2.0),
        ([1.0, INFINITE], 0.5, INFINITE),
        ([1.0, INFINITE, INFINITE], 0.9, INFINITE),
        ([1.0, 2.0, INFINITE], 1.0, INFINITE),
    ],
)
def test_a_quantile_lies_between_the_sorted_values(values: list[float], share: float, expected: float) -> None:
    assert quantile(values, share) == pytest.approx(expected)


def test_a_spread_is_median_ninetieth_percentile_and_maximum() -> None:
    spread = Spread.of([float(value) for value in range(11)])
    assert (spread.median, spread.p90, spread.largest) == (5.0, 9.0, 10.0)
    assert spread.text() == "5.0 / 9.0 / 10.0"
    assert spread.text(0) == "5 / 9 / 10"
    lost = Spread.of([1.0, INFINITE])
    assert lost.text() == "\u221e / \u221e / \u221e"
    assert lost.as_json() == {"median": None, "p90": None, "max": None}
    assert spread.as_json() == {"median": 5.0, "p90": 9.0, "max": 10.0}


def test_runs_without_a_value_do_not_count() -> None:
    assert Spread.of_known([None, 2.0, None]) == Spread(2.0, 2.0, 2.0)
    assert Spread.of_known([None]) is None


def test_an_interval_is_that_of_student() -> None:
    """Of five values: t is 2.776 for 4 degrees of freedom in every table."""
    found = Interval.of([1.0, 2.0, 3.0, 4.0, 5.0])
    half = 2.776 * math.sqrt(2.5 / 5)
    assert (found.mean, found.low, found.high) == pytest.approx((3.0, 3 - half, 3 + half), abs=1e-3)
    assert found.text() == "3.0 [1.0, 5.0]"
    assert Interval.of([4.0]) == Interval(4.0, None, None)
    assert Interval.of([4.0]).text(2) == "4.00"


def test_resampled_intervals_hold_the_mean_of_as_many_samples_as_they_say() -> None:
    assert Interval.resampled([1.0, 2.0, 3.0, 5.0]) == Interval(2.75, None, None)
    few = Interval.resampled([0.0, 0.0, 0.0, 0.0, 5.0])
    assert (few.mean, few.low) == (1.0, 0.0)
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(100):
        found = Interval.resampled(rng.normal(1.0, 1.0, 40).tolist())
        assert found.low is not None
        assert found.high is not None
        held += found.low <= 1.0 <= found.high
    assert 88 <= held <= 99


@pytest.mark.parametrize(
    ("low", "high", "margin", "excludes"),
    [
        (0.1, 0.5, 0.0, True),
        (0.1, 0.5, 0.1, False),
        (-0.5, -0.1, 0.0, True),
        (-0.5, -0.1, 0.1, False),
        (-0.1, 0.5, 0.0, False),
        (0.0, 0.5, 0.0, False),
        (None, None, 0.0, False),
    ],
)
def test_an_effect_is_one_whose_interval_excludes_zero(
    low: float | None, high: float | None, margin: float, excludes: bool
) -> None:
    assert Interval(0.2, low, high).excludes_zero(margin) is excludes
