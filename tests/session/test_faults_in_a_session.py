"""Faults of wires while a session runs: it ends in order, or goes on and says what it met. All of them stand in
``python -m tests.support.session_fault_table``."""

from __future__ import annotations

import pytest

from tests.support.session_hand_faults import FAULTS, CYCLE_s, run_fault
from tests.support.session_sweep import run_with


@pytest.mark.parametrize(
    ("transport", "fault", "words"),
    [
        ("hand", "unplug", "hand: the wire is unplugged"),
        ("base", "delay", "cycles in a row without a status"),
        ("ft/MF", "unplug", "ft/MF: the wire is unplugged"),
    ],
)
def test_a_link_that_fails_ends_the_session_in_order_and_its_recording_is_whole(tmp_path, transport, fault, words):
    swept = run_with("sim", {transport: fault}, tmp_path, phase="bounding box")
    swept.check(transport, fault)
    assert words in swept.ended
    assert swept.replay.startswith("read")


@pytest.mark.long  # quicker: a link that fails, above
@pytest.mark.parametrize("name", ["sensor at 0", "all motors silent"])
def test_a_fault_of_the_hand_takes_its_demands_and_ends_the_session_by_name(tmp_path, name):
    """All of them: ``python -m tests.support.session_hand_fault_table``."""
    fault = FAULTS[name]
    found = run_fault(fault, tmp_path)
    assert fault.told in found.ended
    assert "J3 (motor 1): stopped" in found.ended or "and 9 other motors" in found.ended
    assert found.driven_s <= fault.rule_s + 2 * CYCLE_s + 1e-9


@pytest.mark.long
def test_a_session_goes_on_under_losses_counts_them_and_replays_identically(tmp_path):
    swept = run_with("sim", {"hand": "drop", "base": "truncate", "ft/MF": "stale sequence"}, tmp_path)
    assert not swept.ended
    told = "; ".join(swept.told)
    assert "hand: 3 of " in told
    assert "base: 3 messages were not a positioner status" in told
    assert "3 undecodable base" in told
    assert swept.lost["lost cycles hand"] == 3
    assert "MF: " in told
    assert swept.replay == "identical"
