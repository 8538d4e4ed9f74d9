"""The benchmark of whole steps, in a small size."""

from __future__ import annotations

from tactile_lab.benchmarks.step_times import PLANAR_SHAPES, step_table


def test_every_line_has_a_time_and_says_of_what() -> None:
    table = step_table(long_session=2, planar_grasps=2)
    assert len(table.timings) == 7
    assert all(timing.ms > 0 and timing.note for timing in table.timings)
    assert table.timings[0].repeats == len(PLANAR_SHAPES)
    assert table.timings[0].ms <= table.timings[1].ms
