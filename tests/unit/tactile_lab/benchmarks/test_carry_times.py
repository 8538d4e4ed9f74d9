"""The benchmark of odometry in the hand, in a small size."""

from __future__ import annotations

import pytest

from tactile_lab.benchmarks.carry_times import carry_table


@pytest.mark.long
def test_every_carry_is_timed_with_its_checks() -> None:
    carry, checks, both, largest = carry_table(("cylinder",), grasps=2).timings
    assert carry.repeats == 1
    assert both.ms == pytest.approx(carry.ms + checks.ms)
    assert largest.ms == both.ms
