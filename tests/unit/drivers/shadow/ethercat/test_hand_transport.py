"""Our master against the emulated two-slave hand, in memory and on virtual time."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest

from drivers.core.clock import MonotonicClock, VirtualClock
from drivers.core.errors import CodecError, ConfigurationError, DeviceError
from drivers.emulators.ethercat.shadow_chain import ChainSettings, EmulatedHand, emulated_hand
from drivers.ethercat.frames import Command, Telegram, physical
from drivers.ethercat.master import EtherCatMaster, MasterSettings, Slave
from drivers.ethercat.ports import RawPort
from drivers.ethercat.registers import AL_ERROR, AlCode, AlState, Register, SyncManager
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.ethercat.hand_transport import EthercatSettings, EthercatTransport, find_palm
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.protocol.palm_codec import PalmCommand, PalmStatus
from drivers.shadow.protocol.palm_images import PALMS
from tactile_lab import rigs
from tests.support.memory_port import MemoryPort

FILES = Path(rigs.__file__).parent / "calibrations" / "simulated-hand"
CALIBRATION = JointCalibration.load(FILES / "joints.yaml")
MS = 1_000_000


class Wire:
    """A hand on a ring in memory, and a transport to it."""

    def __init__(self, chain: ChainSettings | None = None, **settings: Any) -> None:
        self.clock = VirtualClock()
        self.hand: EmulatedHand = emulated_hand(self.clock, CALIBRATION, chain)
        self.port = MemoryPort(self.hand.ring)
        self.transport = EthercatTransport(
            "hand", EthercatSettings(interface="memory", **settings), self.clock, self.port
        )
        self.image = PALMS[(chain or ChainSettings()).palm]
        self.parity = 0

    def open(self) -> Wire:
        self.transport.open()
        self.cycles(3)
        return self

    def cycle(self, command: PalmCommand | None = None) -> PalmStatus | None:
        self.clock.sleep_until_ns(self.clock.now_ns() + MS)
        self.parity ^= 1
        command = command or PalmCommand(1, 3, self.parity, 2)
        self.transport.send(self.image.encode_command(command))
        datagrams = self.transport.receive()
        return self.image.decode_status(datagrams[0].payload) if datagrams else None

    def cycles(self, count: int) -> list[PalmStatus | None]:
        return [self.cycle() for _ in range(count)]

    @property
    def states(self) -> list[int]:
        return [slave.al_status.state for slave in self.hand.ring.slaves]

    def master(self) -> EtherCatMaster:
        master = EtherCatMaster(self.port, self.clock)
        master.open()
        return master


def exchange(hand: ShadowHand, cycles: int) -> None:
    for _ in range(cycles):
        hand.exchange()


def test_a_bare_hand_comes_into_operation_and_tells_who_it_is() -> None:
    wire = Wire(ChainSettings(serial=1178))
    wire.transport.open()
    assert wire.states == [AlState.OP, AlState.OP]
    found = wire.transport.hand
    assert (found.serial, found.image.name, found.palm.vendor, found.bridge.product) == (1178, "0220", 0x530, 0)
    assert found.watchdog_s is None


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_the_product_code_tells_the_palm_without_touching_the_slaves(palm: Any) -> None:
    wire = Wire(ChainSettings(palm=palm)).open()
    assert find_palm(EthercatSettings(interface="memory"), wire.clock, MemoryPort(wire.hand.ring)) == palm
    assert wire.states == [AlState.OP, AlState.OP]
    assert wire.cycle() is not None


def test_a_product_code_that_can_not_be_driven_is_told_with_what_to_do() -> None:
    wire = Wire(ChainSettings(product=0x0B))
    with pytest.raises(DeviceError, match=r"a board this program does not know \(product 0xb\)") as told:
        find_palm(EthercatSettings(interface="memory"), wire.clock, wire.port)
    assert "0220, 0230, 0240 and 0250 are supported; ask Shadow Robot" in str(told.value)
    with pytest.raises(DeviceError, match="not open"):
        wire.port.send(b"")


def test_two_hands_on_one_cable_are_told_with_their_serial_numbers() -> None:
    wire = Wire(ChainSettings(serial=378))
    wire.hand.ring.slaves += emulated_hand(wire.clock, CALIBRATION, ChainSettings(serial=554)).ring.slaves
    with pytest.raises(DeviceError, match=r"two hands on one cable, 378 and 554\. Connect each hand to an interface"):
        wire.transport.open()


def test_a_stated_palm_is_not_looked_for() -> None:
    stated = EthercatSettings(interface="nosuch0", palm="0240")
    looked_for = setup_of(EthercatSettings(interface="nosuch0"), palm="0230").with_known_palm(VirtualClock())
    assert looked_for.hand.palm == "0230"
    assert setup_of(stated).with_known_palm(VirtualClock()).hand.palm == "0240"
    with pytest.raises(DeviceError, match="nosuch0: no such network interface"):
        setup_of(EthercatSettings(interface="nosuch0")).with_known_palm(VirtualClock())
    with pytest.raises(ConfigurationError, match="palm differ"):
        setup_of(stated, palm="0230").transport(VirtualClock())


def setup_of(ethercat: EthercatSettings, **hand: Any) -> HandSetup:
    return HandSetup(
        ethercat=ethercat, hand=HandSettings(**hand), joints=FILES / "joints.yaml", motors=FILES / "motors.yaml"
    )


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_images_go_both_ways_in_the_layout_of_the_product(palm: Any) -> None:
    wire = Wire(ChainSettings(palm=palm)).open()
    assert wire.transport.hand.image.name == palm
    asked = wire.cycle(PalmCommand(1, 4, 1, 2))
    answer = wire.cycle(PalmCommand(1, 3, 0, 2))
    assert asked is not None
    assert answer is not None
    assert answer.written
    assert (answer.motor_data_type, answer.which_motors, answer.arrived) == (4, 1, 0xAAAAA)
    assert wire.transport.counts.empty <= 2


@pytest.mark.parametrize("palm", ["0220", "0230", "0240", "0250"])
def test_the_hand_driver_moves_a_joint_over_ethercat(palm: Any) -> None:
    wire = Wire(ChainSettings(palm=palm))
    hand = ShadowHand(wire.transport, wire.clock, CALIBRATION, HandSettings(palm=palm, cycle_s=0.001, soft_start_s=0.0))
    hand.connect()
    hand.set_targets({"FFJ3": 1.0})
    for _ in range(700):
        wire.clock.sleep_until_ns(wire.clock.now_ns() + MS)
        sample = hand.exchange()
    assert sample.fresh
    assert wire.hand.plant.joints_rad[2] == pytest.approx(1.0, abs=0.05)
    hand.close()
    assert wire.states == [AlState.INIT, AlState.INIT]


def test_before_its_first_service_the_palm_shows_its_marks() -> None:
    wire = Wire()
    wire.transport.open()
    master = wire.master()
    palm = Slave(1, 2)
    master.change_state(palm, AlState.PREOP)
    master.change_state(palm, AlState.SAFEOP)
    assert master.read(palm, 0x1046, 220)[:8] == bytes.fromhex("cc000000adde adde")


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


@pytest.mark.parametrize(
    ("chain", "settings", "words"),
    [
        (ChainSettings(vendor=0x2), {}, "first slave is from vendor 0x2, not from Shadow Robot"),
        (ChainSettings(product=0x01000002), {}, "second slave is a muscle hand"),
        (ChainSettings(product=77), {}, r"does not know \(product 0x4d\)"),
        (ChainSettings(palm="0240"), {"palm": "0220"}, 'a 0240 palm, not a 0220. Set hand.palm to "0240"'),
        (ChainSettings(serial=3), {"serial": 4}, "hand 3, not hand 4"),
        (ChainSettings(palm="0230", product=0x01000001), {"side": "right"}, "the palm of a left hand, not of a right"),
    ],
)
def test_a_wrong_device_is_named_with_what_to_do(chain: ChainSettings, settings: Any, words: str) -> None:
    wire = Wire(chain, **settings)
    with pytest.raises(DeviceError, match=words):
        wire.transport.open()
    with pytest.raises(DeviceError, match="not open"):
        wire.transport.send(bytes(70))


@pytest.mark.parametrize(("connected", "words"), [(0, "0 EtherCAT slaves"), (1, "1 EtherCAT slaves instead of")])
def test_an_incomplete_ring_is_named(connected: int, words: str) -> None:
    wire = Wire()
    wire.hand.ring.faults.connected = connected
    with pytest.raises(DeviceError, match=words):
        wire.transport.open()


def test_a_silent_wire_is_named() -> None:
    wire = Wire()
    wire.hand.ring.faults.drop = 1000
    with pytest.raises(DeviceError, match="no EtherCAT frame comes back"):
        wire.transport.open()


def test_frames_lost_while_setting_up_are_sent_again() -> None:
    wire = Wire(ChainSettings(seed=1))
    wire.hand.ring.faults.drop_share = 0.05
    wire.transport.open()
    assert wire.states == [AlState.OP, AlState.OP]


def test_a_command_of_another_palm_is_refused_before_it_is_sent() -> None:
    wire = Wire().open()
    with pytest.raises(CodecError, match="a command of 74 bytes instead of 70"):
        wire.transport.send(bytes(74))


def test_opening_twice_and_closing_twice_do_no_harm() -> None:
    wire = Wire().open()
    wire.transport.open()
    assert wire.transport.counts.openings == 1
    wire.transport.close()
    wire.transport.close()
    wire.transport.open()
    assert all(status is not None for status in wire.cycles(3))


def test_a_missing_interface_is_named_beside_those_present() -> None:
    with pytest.raises(DeviceError, match=r"nosuch0: no such network interface. Available interfaces: .*lo"):
        EthercatTransport("hand", EthercatSettings(interface="nosuch0"), MonotonicClock()).open()


def test_without_the_right_to_raw_sockets_the_hint_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("drivers.ethercat.ports.socket.socket", refuse)
    with pytest.raises(DeviceError, match=r"no permission for raw sockets.*setcap cap_net_raw"):
        RawPort("lo").open()


# --- a slave without a processor, as the bridge probably is ---------------------------------------------------------


def test_a_slave_in_device_emulation_shows_an_acknowledge_as_an_error() -> None:
    wire = Wire()
    master, bridge = wire.master(), Slave(0)
    master.write(bridge, Register.AL_CONTROL, struct.pack("<H", AlState.INIT | AL_ERROR))
    assert str(master.al_status(bridge)) == "INIT with error 0x0000, no reason given"
    master.write(bridge, Register.AL_CONTROL, struct.pack("<H", AlState.OP))
    assert str(master.al_status(bridge)) == "OP"


def test_what_another_master_left_behind_in_the_bridge_does_not_keep_it_from_starting() -> None:
    wire = Wire()
    wire.master().write(Slave(0), Register.AL_CONTROL, struct.pack("<H", AlState.INIT | AL_ERROR))
    wire.hand.palm_slave.fall_to(AlState.PREOP, AlCode.UNSPECIFIED)  # an error that stands is acknowledged
    wire.transport.open()
    assert wire.states == [AlState.OP, AlState.OP]


# --- the emulated slave refuses what a real one refuses -----------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted", "code"),
    [
        (AlState.SAFEOP, AlCode.INVALID_STATE_CHANGE),
        (AlState.OP, AlCode.INVALID_STATE_CHANGE),
        (AlState.BOOT, AlCode.BOOT_NOT_SUPPORTED),
        (7, AlCode.UNKNOWN_STATE),
    ],
)
def test_a_slave_refuses_a_wrong_step_until_the_error_is_acknowledged(wanted: int, code: int) -> None:
    wire = Wire()
    master, palm = wire.master(), Slave(1)
    master.write(palm, Register.AL_CONTROL, struct.pack("<H", wanted))
    assert (master.al_status(palm).state, master.al_status(palm).code) == (AlState.INIT, code)
    master.write(palm, Register.AL_CONTROL, struct.pack("<H", AlState.PREOP))
    assert master.al_status(palm).error
    master.change_state(palm, AlState.PREOP)
    assert not master.al_status(palm).error


@pytest.mark.parametrize(("skip", "code"), [(0, AlCode.INVALID_OUTPUTS), (2, AlCode.INVALID_INPUTS)])
def test_a_palm_refuses_safeop_without_its_sync_managers(skip: int, code: int) -> None:
    wire = Wire()
    master, palm = wire.master(), Slave(1)
    master.change_state(palm, AlState.PREOP)
    for number, manager in enumerate(PALMS["0220"].sync_managers()):
        if number != skip:
            master.write(palm, Register.SYNC_MANAGER + 8 * number, manager.encode())
    with pytest.raises(DeviceError, match=f"slave 1 does not enter SAFEOP: it is in PREOP with error 0x{code:04X}"):
        master.change_state(palm, AlState.SAFEOP)


def test_a_one_buffer_block_takes_one_write_and_gives_one_read() -> None:
    wire = Wire()
    master, palm = wire.master(), Slave(1)
    wire.hand.palm.sync_managers = (SyncManager(0x1000, 4, to_slave=True), SyncManager(0x1004, 4, to_slave=False))
    for number, manager in enumerate(wire.hand.palm.sync_managers):
        master.write(palm, Register.SYNC_MANAGER + 8 * number, manager.encode())
    write = Telegram(Command.APWR, physical(-1, 0x1000), b"1234")
    read = Telegram(Command.APRD, physical(-1, 0x1004), bytes(4))
    assert [master.ask(write).working_counter for _ in range(2)] == [1, 0]
    assert master.ask(read).working_counter == 0
    assert wire.hand.palm_slave.counts.refused == 1


def test_read_only_registers_and_missing_memory_are_not_written() -> None:
    master = Wire().master()
    for register in (0x0000, 0x0110, 0x0130, 0x2000):
        assert master.ask(Telegram(Command.APWR, physical(0, register), b"\x55")).working_counter == 0
    assert master.ask(Telegram(Command.BRD, 0, bytes(1))).working_counter == 2


def test_an_eeprom_that_stays_busy_or_fails_is_named() -> None:
    wire = Wire()
    settings = MasterSettings(eeprom_tries=3)
    master = EtherCatMaster(wire.port, wire.clock, settings)
    master.open()
    wire.hand.palm_slave.eeprom.busy = 50
    with pytest.raises(DeviceError, match="EEPROM of slave 1 stays busy"):
        master.read_eeprom(Slave(1), 0x0A)
    with pytest.raises(DeviceError, match="slave 5 does not answer"):
        master.read_eeprom(Slave(5), 0x0A)


def test_read_write_and_multiple_telegrams_count_as_the_standard_says() -> None:
    wire = Wire().open()
    master = wire.master()
    both = Telegram(Command.BRW, physical(0, 0x0012), b"\x11\x00")
    assert master.ask(both).working_counter == 6
    spread = Telegram(Command.ARMW, physical(0, 0x0012), bytes(2))
    assert master.ask(spread).working_counter == 2
    assert master.ask(Telegram(Command.NOP, 0, bytes(2))).working_counter == 0
