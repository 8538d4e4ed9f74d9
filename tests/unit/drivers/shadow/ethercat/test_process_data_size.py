"""A palm whose process data have another size than its code's image: named before its slaves do anything."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import pytest

from drivers.core.errors import DeviceError
from drivers.emulators.ethercat.eeprom import SlaveIdentity, mapped_eeprom
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from drivers.emulators.ethercat.slave import SlaveController
from drivers.ethercat.master import Slave
from drivers.ethercat.registers import AlState, SyncManager
from drivers.shadow.ethercat.process_data_size import stated_sizes
from drivers.shadow.protocol.palm_images import PALMS, PalmName
from tests.support.emulated_hand_wire import Wire


def longer(managers: tuple[SyncManager, ...]) -> tuple[SyncManager, ...]:
    """The same with 14 more bytes of status."""
    return tuple(each if each.to_slave else replace(each, length=each.length + 7) for each in managers)


def wire_with(palm: PalmName, eeprom: Literal["bare", "mapped"]) -> Wire:
    """A palm with another layout than its product code says."""
    wire = Wire(ChainSettings(palm=palm, eeprom=eeprom))
    slave = wire.hand.palm_slave
    slave.application.sync_managers = managers = longer(slave.application.sync_managers)
    if eeprom == "mapped":
        content = mapped_eeprom(SlaveIdentity(0x530, PALMS[palm].products[0], 0, 1), "palm", managers)
        wire.hand.ring.slaves = (wire.hand.ring.slaves[0], SlaveController(content, slave.application, wire.clock))
    return wire


@pytest.mark.parametrize("palm", list(PALMS))
def test_an_emulated_palm_states_the_size_of_its_image(palm: PalmName) -> None:
    image = PALMS[palm]
    mapped, bare = (Wire(ChainSettings(palm=palm, eeprom=kind)).master() for kind in ("mapped", "bare"))
    assert stated_sizes(mapped, Slave(1)) == (image.command_bytes, image.status_bytes)
    assert stated_sizes(bare, Slave(1)) == stated_sizes(mapped, Slave(0)) == (0, 0)


def test_a_palm_0250_of_another_layout_is_refused_before_a_slave_changes_its_state() -> None:
    wire = wire_with("0250", "mapped")
    told = r"process data are 74 bytes of command and 556 of status; those of palm 0250 are 74 and 542.* ask Shadow"
    with pytest.raises(DeviceError, match=told):
        wire.open()
    assert wire.states == [AlState.INIT, AlState.INIT]


@pytest.mark.parametrize("palm", list(PALMS))
def test_a_palm_that_refuses_the_size_is_named_with_it(palm: PalmName) -> None:
    wire = wire_with(palm, "bare")
    with pytest.raises(DeviceError, match=rf"process data are of another size or place; those of palm {palm} are"):
        wire.open()
    assert wire.states[1] == AlState.PREOP
