"""The hand's link: watchdog, missing slaves, bad cables, and links that are gone for a while."""

from __future__ import annotations

import pytest

from drivers.core.errors import DeviceError
from drivers.emulators.ethercat.shadow_chain import ChainSettings, emulated_hand
from drivers.ethercat.master import Slave
from drivers.ethercat.registers import AlCode, AlState, Register
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from tests.support.emulated_hand_wire import CALIBRATION, MS, Wire


def exchange(hand: ShadowHand, cycles: int) -> None:
    for _ in range(cycles):
        hand.exchange()


def test_a_palm_that_leaves_operation_ends_the_link_in_words() -> None:
    wire = Wire(poll_every=5).open()
    wire.hand.palm_slave.fall_to(AlState.SAFEOP, AlCode.SYNCHRONISATION)
    with pytest.raises(DeviceError, match=r"palm has left operation: it is in SAFEOP with error 0x001A, lost synchron"):
        wire.cycles(8)
    with pytest.raises(DeviceError, match="0x001A"):
        wire.cycle()
    wire.transport.open()
    assert wire.states == [AlState.OP, AlState.OP]
    assert wire.transport.counts.openings == 2


def test_a_watchdog_that_is_set_reads_back_and_trips_and_the_palm_is_brought_back() -> None:
    wire = Wire(watchdog_s=0.05).open()
    assert wire.transport.hand.watchdog_s == pytest.approx(0.05)
    wire.clock.sleep_until_ns(wire.clock.now_ns() + 60 * MS)
    statuses = wire.cycles(110)
    assert wire.hand.palm_slave.counts.watchdog_trips == wire.transport.counts.restarts == 1
    assert wire.states == [AlState.OP, AlState.OP]
    assert statuses[-1] is not None
    assert "the palm's watchdog tripped 1 times because no commands came" in wire.transport.health()


@pytest.mark.parametrize(
    ("holds", "words"), [(b"\xe8\x03", "reads back 100.0 ms"), (b"\0\0", "reads back as switched off")]
)
def test_a_watchdog_that_is_longer_than_asked_is_refused(holds: bytes, words: str) -> None:
    wire = Wire(watchdog_s=0.05)
    wire.master().write(Slave(1), Register.WATCHDOG_TIME, holds)
    wire.hand.palm_slave.fixed.append(Register.WATCHDOG_TIME)
    with pytest.raises(DeviceError, match=rf"watchdog {words} where 50\.0 ms were asked for"):
        wire.transport.open()


def test_a_watchdog_whose_divider_leaves_it_too_little_time_is_refused() -> None:
    wire = Wire(watchdog_s=0.1)
    wire.master().write(Slave(1), Register.WATCHDOG_DIVIDER, b"\0\0")
    with pytest.raises(DeviceError, match=r"the palm's watchdog can wait 5\.2 ms only, 100\.0 ms were asked for"):
        wire.transport.open()


def test_without_a_watchdog_a_pause_does_not_end_operation() -> None:
    wire = Wire(poll_every=1).open()
    wire.clock.sleep_until_ns(wire.clock.now_ns() + 5000 * MS)
    assert all(status is not None for status in wire.cycles(3))


def test_a_slave_that_vanishes_from_the_ring_is_noticed_at_once_and_its_cable_named_when_it_is_back() -> None:
    wire = Wire(poll_every=1000).open()
    wire.hand.ring.faults.connected = 1
    wire.cycles(3)
    assert wire.transport.health()[0] == "1 EtherCAT slaves answer instead of 2"
    wire.hand.ring.faults.connected = None
    assert all(status is not None for status in wire.cycles(3)[1:])
    inside = "the cable inside the hand, between bridge and palm: link lost 1 times; the hand needs service"
    assert wire.transport.health()[0] == inside


@pytest.mark.parametrize(
    ("at", "cable"), [(0, "the cable between computer and hand"), (1, "the cable inside the hand")]
)
def test_damaged_frames_name_the_cable_they_were_damaged_on(at: int, cable: str) -> None:
    wire = Wire(poll_every=1000).open()
    wire.hand.ring.faults.damage, wire.hand.ring.faults.damaged_at = 3, at
    wire.cycles(5)
    first, *others = wire.transport.health()
    assert first.startswith(cable)
    assert ": 3 damaged frames; " in first
    assert not any(other.startswith("the cable") for other in others)
    wire.transport.close()
    wire.transport.open()
    assert wire.transport.health() == ()  # each opening counts from zero


def test_a_link_that_is_back_within_two_seconds_goes_on_by_itself_without_a_demand_meanwhile() -> None:
    wire = Wire(watchdog_s=0.05)
    hand = ShadowHand(wire.transport, wire.clock, CALIBRATION, HandSettings(cycle_s=0.001, soft_start_s=0.1))
    hand.connect()
    hand.set_targets({"FFJ3": 1.4})
    run(wire, hand, 20)
    wire.hand.ring.faults.unplugged = True
    wire.hand.ring.work()  # the palm's processor goes on with the command it has
    run(wire, hand, 1900)
    held_rad = wire.hand.plant.joints_rad[2]
    wire.hand.ring.faults.unplugged = False
    run(wire, hand, 5)
    assert wire.hand.plant.joints_rad[2] == pytest.approx(held_rad, abs=0.002)  # demands rise from zero
    run(wire, hand, 600)
    assert wire.hand.plant.joints_rad[2] == pytest.approx(1.4, abs=0.05)
    assert wire.transport.counts.restarts == 1  # its watchdog had tripped
    told = hand.health() + wire.transport.health()
    assert any(words.startswith("the cable between computer and hand: link lost 1 times") for words in told)
    hand.close()


def test_a_link_that_stays_away_stops_the_hand_and_says_which_part_of_it() -> None:
    wire = Wire()
    hand = ShadowHand(wire.transport, wire.clock, CALIBRATION, HandSettings(cycle_s=0.001))
    hand.connect()
    hand.set_targets({"FFJ3": 1.4})
    wire.hand.ring.faults.connected = 1
    with pytest.raises(DeviceError, match="stopped: no valid status for 2 s: 1 EtherCAT slaves answer instead of 2"):
        run(wire, hand, 2100)
    wire.hand.ring.faults.connected = None
    with pytest.raises(DeviceError, match="no valid status"):
        run(wire, hand, 3)
    assert hand.reconnect() < 1000 * MS


def run(wire: Wire, hand: ShadowHand, cycles: int) -> None:
    for _ in range(cycles):
        wire.clock.sleep_until_ns(wire.clock.now_ns() + MS)
        hand.exchange()


def test_a_slave_more_on_the_ring_is_noticed_at_the_next_poll() -> None:
    wire = Wire(poll_every=10).open()
    wire.hand.ring.slaves += (emulated_hand(wire.clock, CALIBRATION).palm_slave,)
    with pytest.raises(DeviceError, match="3 EtherCAT slaves answer instead of 2"):
        wire.cycles(12)


def test_another_hand_on_the_cable_ends_the_link_and_is_not_taken_for_the_first() -> None:
    wire = Wire(ChainSettings(serial=634), poll_every=1000).open()
    first = wire.hand.ring.slaves
    wire.hand.ring.slaves = emulated_hand(wire.clock, CALIBRATION, ChainSettings(serial=12)).ring.slaves
    with pytest.raises(DeviceError, match="the palm has left operation: it is in INIT"):
        wire.cycles(3)
    with pytest.raises(DeviceError, match=r"hand 12, palm 0220, answers instead of hand 634.*the former hand"):
        wire.transport.open()
    with pytest.raises(DeviceError, match="not open"):
        wire.transport.send(bytes(70))
    wire.hand.ring.slaves = first
    wire.open()
    assert wire.transport.hand.serial == 634


def test_after_a_power_cut_the_hand_reconnects() -> None:
    wire = Wire()
    hand = ShadowHand(wire.transport, wire.clock, CALIBRATION, HandSettings(cycle_s=0.001))
    hand.connect()
    hand.set_targets({"FFJ3": 1.0})
    for slave in wire.hand.ring.slaves:
        slave.power_cycle()
    with pytest.raises(DeviceError, match="has left operation"):
        exchange(hand, 4)
    assert "left operation" in hand.health()[0]
    assert hand.reconnect() < 1000 * MS
    assert hand.targets_rad == {}
    wire.clock.sleep_until_ns(wire.clock.now_ns() + MS)
    assert hand.exchange().fresh
    hand.close()


def test_a_link_failure_takes_the_demands_away_and_stays_until_reconnected() -> None:
    wire = Wire(poll_every=1)
    hand = ShadowHand(wire.transport, wire.clock, CALIBRATION, HandSettings(cycle_s=0.001, soft_start_s=0.0))
    hand.connect()
    hand.set_targets({"FFJ3": 1.4})
    for _ in range(5):
        wire.clock.sleep_until_ns(wire.clock.now_ns() + MS)
        hand.exchange()
    wire.hand.palm_slave.fall_to(AlState.SAFEOP, AlCode.UNSPECIFIED)
    for _ in range(3):
        wire.clock.sleep_until_ns(wire.clock.now_ns() + MS)
        with pytest.raises(DeviceError, match="SAFEOP"):
            hand.exchange()
    wire.clock.sleep_until_ns(wire.clock.now_ns() + 20 * MS)
    turned = wire.hand.plant.joints_rad[2]
    wire.clock.sleep_until_ns(wire.clock.now_ns() + 100 * MS)
    assert wire.hand.plant.joints_rad[2] == turned
    with pytest.raises(DeviceError, match="SAFEOP"):
        hand.close()
