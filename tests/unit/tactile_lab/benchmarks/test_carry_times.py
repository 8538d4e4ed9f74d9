"""The benchmark of odometry in the hand, in a small size."""

from __future__ import annotations

import pytest

from tactile_lab.benchmarks.carry_times import carry_table


@pytest.mark.long
def test_every_carry_is_timed_with_its_checks() -> None:
    carry, longest_carry, checks, longest_checks = carry_table(("cylinder",), grasps=2).timings
    assert carry.repeats == checks.repeats == 1
    assert 0 < carry.ms == longest_carry.ms
    assert 0 < checks.ms == longest_checks.ms
