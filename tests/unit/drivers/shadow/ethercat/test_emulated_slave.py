"""The emulated slave refuses what a real one refuses."""

from __future__ import annotations

import struct

import pytest

from drivers.core.errors import DeviceError
from drivers.ethercat.frames import Command, Telegram, physical
from drivers.ethercat.master import EtherCatMaster, MasterSettings, Slave
from drivers.ethercat.registers import AL_ERROR, AlCode, AlState, Register, SyncManager
from drivers.shadow.protocol.palm_images import PALMS
from tests.support.emulated_hand_wire import Wire


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
