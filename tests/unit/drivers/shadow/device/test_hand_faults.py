"""Each fault of a moving hand: its demands are gone within two cycles of when it can be seen, and what it says."""

from __future__ import annotations

import pytest

from tests.support.hand_faults import FAULTS, CYCLE_s, run_fault

MOST_CYCLES = 2


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_takes_the_demands_away_within_two_cycles_and_is_told_in_words(name: str) -> None:
    outcome = run_fault(FAULTS[name])
    assert outcome.driven_cycles <= MOST_CYCLES
    assert outcome.still_cycles <= MOST_CYCLES + round(0.02 / CYCLE_s), "motors that hear nothing halt after 20 ms"
    assert FAULTS[name].told in outcome.told
    assert outcome.goes_on == (not FAULTS[name].told)
