"""The benchmarks measure what they say, and say what they measured."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_lab.benchmarks.components import (
    THESIS_WEIGHTING_ms,
    Timing,
    TimingTable,
    median_ms,
    weighting_case,
    weighting_table,
)
from tactile_lab.slam.shape.fields.field_grid import FieldGrid
from tactile_lab.slam.tracking.filter.measurement import CalibratedMeasurement, CalibratedSettings, Known


class SteppingClock:
    """Every look at it is a millisecond later than the last."""

    def __init__(self) -> None:
        self._now_ns = 0

    def now_ns(self) -> int:
        self._now_ns += 1_000_000
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        raise AssertionError("a benchmark does not wait")


def test_durations_come_from_the_given_clock_and_only_the_thesis_is_quoted() -> None:
    table = weighting_table(SteppingClock(), particles=50, repeats=2)
    measured, quoted = table.timings[:-1], table.timings[-1]
    assert [timing.ms for timing in measured] == [1.0] * len(measured)
    assert all(timing.repeats == 2 and timing.peak_MB is not None for timing in measured)
    assert (quoted.ms, quoted.repeats, quoted.peak_MB) == (THESIS_WEIGHTING_ms, 0, None)
    assert {"ours, from the grid", "scikit-learn", "thesis"} <= {timing.name for timing in table.timings}


def test_the_first_run_is_not_counted_and_the_median_of_the_others_is_told() -> None:
    clock, spent_ms = SteppingClock(), iter([90, 1, 2, 40])

    def work() -> None:
        for _ in range(next(spent_ms)):
            clock.now_ns()

    assert median_ms(work, clock.now_ns, 3) == 3.0  # two and one that the look at the clock takes


def test_the_grid_weighs_as_the_field_does() -> None:
    case = weighting_case(300)
    model = CalibratedMeasurement(CalibratedSettings())
    known = [Known(field, case.contacts) for field in (FieldGrid.around(case.field), case.field)]
    grid, direct = (model.log_likelihood(case.rows, case.grasp, each) for each in known)
    assert np.corrcoef(grid, direct)[0, 1] > 0.99


def test_ratios_refer_to_the_first_line() -> None:
    table = TimingTable("t", (Timing("ours", 2.0, 3, 1.5, "how"), Timing("theirs", 5.0, 3, None, "")))
    assert table.rows() == [("ours", "2", "1", "1.5", "how"), ("theirs", "5", "2.5", "", "")]
    assert table.as_json()["timings"][1]["ms"] == pytest.approx(5.0)
