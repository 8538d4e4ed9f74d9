"""Frames that are lost, late or damaged on the hand's cable."""

from __future__ import annotations

from drivers.emulators.ethercat.shadow_chain import ChainSettings
from tests.support.emulated_hand_wire import MS, Wire


def test_a_late_palm_gives_an_empty_status_not_an_old_one() -> None:
    wire = Wire().open()
    before = wire.transport.counts
    wire.hand.palm.service_ns = 3 * MS
    statuses = [status for status in wire.cycles(12) if status is not None]
    assert len(statuses) == 12
    assert {status.edc_command for status in statuses} == {0, 1}
    assert wire.transport.counts.empty - before.empty >= 6
    assert wire.transport.counts.refused - before.refused >= 6
    assert wire.transport.counts.lost == 0
    assert any("without a new status" in words for words in wire.transport.health())


def test_lost_frames_are_counted_and_the_next_cycle_is_whole_again() -> None:
    wire = Wire().open()
    wire.hand.ring.faults.drop = 2
    assert [status is None for status in wire.cycles(3)] == [True, True, False]
    wire.hand.ring.faults.drop_answers = 1
    assert wire.cycle() is None
    wire.cycle()
    status = wire.cycle()
    assert status is not None
    assert status.written
    assert (wire.transport.counts.lost, wire.hand.ring.counts.lost) == (3, 3)
    assert "3 of " in wire.transport.health()[0]


def test_random_losses_are_counted_as_the_slaves_count_them() -> None:
    wire = Wire(ChainSettings(seed=3)).open()
    wire.hand.ring.faults.drop_share = 0.05
    wire.cycles(400)
    assert wire.transport.counts.lost == wire.hand.ring.counts.lost > 5


def test_answers_that_come_late_are_thrown_away() -> None:
    wire = Wire().open()
    wire.hand.ring.faults.hold = 4
    assert wire.cycles(4) == [None] * 4
    status = wire.cycle()
    assert status is not None
    assert status.which_motors != wire.parity
    assert (wire.transport.counts.stale, wire.transport.counts.lost) == (4, 4)


def test_a_damaged_answer_is_counted_and_not_used() -> None:
    wire = Wire().open()
    good = wire.hand.ring.process
    wire.hand.ring.process = lambda frame: [answer[:40] for answer in good(frame)]  # type: ignore[method-assign]
    assert wire.cycle() is None
    assert wire.transport.counts.damaged == 1
