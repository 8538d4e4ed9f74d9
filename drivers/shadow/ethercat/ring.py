"""Bringing the hand's two slaves into operation, in the order of Shadow's own master (protocols: Bring-up)."""

from __future__ import annotations

import struct
from collections.abc import Iterable

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import DeviceError
from drivers.ethercat.frames import Command, Telegram
from drivers.ethercat.master import EtherCatMaster, Slave
from drivers.ethercat.registers import FMMU_BYTES, SYNC_MANAGER_BYTES, AlState, Register
from drivers.shadow.ethercat.hand_identity import SERIAL_WORD, BoardIdentity, HandIdentity, checked_image
from drivers.shadow.ethercat.process_data_size import OTHER_SIZE, check_size, other_size
from drivers.shadow.protocol.palm_images import BRIDGE_PRODUCT, IMAGE_BASE, PalmImage, PalmName, Side

_VENDOR, _PRODUCT, _REVISION = 0x08, 0x0A, 0x0C
_ALL_REGISTERS = bytes(256)
_FIRST_EXCHANGES = 20
_LOOP_CONTROL_MASK = 0x3FFF
_NANOSECONDS_PER_TICK = 40
_SHORTEST_WATCHDOG_s = 0.02  # a change of state alone takes half of it


class HandRing:
    """The hand's ring.

    Args:
        master: on the interface the hand is plugged into.
        palm: the palm that must be there; any that can be driven when None.
        serial: the hand that must be there; any when None.
        watchdog_s: let commands feed the palm's watchdog, and set it to this time; unused when None.
    """

    BRIDGE, PALM = Slave(0, 1), Slave(1, 2)

    def __init__(
        self,
        master: EtherCatMaster,
        palm: PalmName | None = None,
        serial: int | None = None,
        watchdog_s: float | None = None,
        side: Side | None = None,
    ) -> None:
        self._master, self._palm, self._serial, self._watchdog_s = master, palm, serial, watchdog_s
        self._side = side

    def bring_up(self) -> HandIdentity:
        """From power-up, or from wherever the slaves are, to OP with an all-zero image exchanged.

        Raises:
            DeviceError: what is missing or wrong, and what to do.
        """
        bridge, palm, image = self.look()
        self._master.broadcast(Register.FMMU, _ALL_REGISTERS)
        self._master.broadcast(Register.SYNC_MANAGER, _ALL_REGISTERS)
        self._give_addresses()
        self._all_to(AlState.PREOP)
        self._open_loop_port()
        watchdog_s = self._map(image)
        self._enter_safeop(image)
        self._all_to(AlState.OP)
        self._exchange_zeros(image)
        return HandIdentity(bridge, palm, image, watchdog_s)

    def resume(self, image: PalmImage) -> None:
        """Back to OP from SAFEOP, where the palm's watchdog has left it; only zeros are commanded.

        Raises:
            DeviceError: the palm refuses, or does not answer.
        """
        for state in (AlState.SAFEOP, AlState.OP):
            self._master.change_state(self.PALM, state)
        self._exchange_zeros(image)

    # --- who is there ------------------------------------------------------------------------------------------

    def look(self) -> tuple[BoardIdentity, BoardIdentity, PalmImage]:
        """Bridge and palm by their EEPROMs, and the process image that belongs to the palm's product code.

        No slave changes its state.

        Raises:
            DeviceError: what is missing or wrong, and what to do.
        """
        self._check_ring()
        bridge, palm = self._identify(0), self._identify(1)
        image = checked_image(bridge, palm, self._palm, self._serial, self._master.where, self._side)
        check_size(self._master, Slave(1), image)
        return bridge, palm, image

    def _check_ring(self) -> None:
        count = self._master.count_slaves()
        if count == 4 and all(self._identify(place).product == BRIDGE_PRODUCT for place in (0, 2)):
            serials = " and ".join(str(self._identify(place).serial) for place in (1, 3))
            raise self._wrong(f"two hands on one cable, {serials}", "Connect each hand to an interface of its own")
        if count != 2:
            hint = "Only the hand may be on this interface: check its cable, its power, and the name of the interface"
            raise self._wrong(f"{count} EtherCAT slaves instead of the hand's bridge and palm", hint)

    def _identify(self, position: int) -> BoardIdentity:
        slave = Slave(position)
        words = [self._master.read_eeprom(slave, word) for word in (_PRODUCT, _REVISION, SERIAL_WORD, _VENDOR)]
        product, revision, serial, vendor = words
        return BoardIdentity(vendor, product, revision, serial)

    # --- set-up ------------------------------------------------------------------------------------------------

    def _give_addresses(self) -> None:
        for slave in (self.BRIDGE, self.PALM):
            unnamed = Slave(slave.position)
            self._master.change_state(unnamed, AlState.INIT)
            self._master.write(unnamed, Register.STATION_ADDRESS, struct.pack("<H", slave.station))

    def _all_to(self, state: AlState) -> None:
        for slave in (self.BRIDGE, self.PALM):
            self._master.change_state(slave, state)

    def _enter_safeop(self, image: PalmImage) -> None:
        try:
            self._all_to(AlState.SAFEOP)
        except DeviceError as error:
            if self._master.al_status(self.PALM).code not in OTHER_SIZE:
                raise
            raise other_size(image, self._master.where, "of another size or place") from error

    def _open_loop_port(self) -> None:
        """The bridge's port that leads on to the palm follows its transport by itself, as Shadow's driver sets it."""
        (control,) = struct.unpack("<H", self._master.read(self.BRIDGE, Register.DL_CONTROL, 2))
        self._master.write(self.BRIDGE, Register.DL_CONTROL, struct.pack("<H", control & _LOOP_CONTROL_MASK))

    def _map(self, image: PalmImage) -> float | None:
        """Program the palm's process image; the watchdog's time as it reads back."""
        watched = self._watchdog_s is not None
        self._write_all(Register.FMMU, FMMU_BYTES, (each.encode() for each in image.fmmus()))
        managers = image.sync_managers(watched=watched)
        self._write_all(Register.SYNC_MANAGER, SYNC_MANAGER_BYTES, (each.encode() for each in managers))
        return None if self._watchdog_s is None else self._set_watchdog(self._watchdog_s)

    def _set_watchdog(self, wanted_s: float) -> float:
        """Ask for the watchdog's time; what it reads back, which is less where the slave's divider is small."""
        tick_s = self._watchdog_tick_s()
        ticks = min(max(round(wanted_s / tick_s), 1), 0xFFFF)
        self._master.write(self.PALM, Register.WATCHDOG_TIME, struct.pack("<H", ticks))
        (found,) = struct.unpack("<H", self._master.read(self.PALM, Register.WATCHDOG_TIME, 2))
        if not found or found > ticks:
            reads = f"reads back {1000 * found * tick_s:.1f} ms" if found else "reads back as switched off"
            what = f"the palm's watchdog {reads} where {1000 * wanted_s:.1f} ms were asked for"
            hint = "Leave watchdog_s out to rely on the motors' own halt after 20 ms, or ask for what it can do"
            raise self._wrong(what, hint)
        found_s = float(found * tick_s)
        if found_s < min(wanted_s, _SHORTEST_WATCHDOG_s):
            what = f"the palm's watchdog can wait {1000 * found_s:.1f} ms only, {1000 * wanted_s:.1f} ms were asked for"
            raise self._wrong(what, "Leave watchdog_s out: the motors halt by themselves after 20 ms")
        return found_s

    def _watchdog_tick_s(self) -> float:
        (divider,) = struct.unpack("<H", self._master.read(self.PALM, Register.WATCHDOG_DIVIDER, 2))
        return (int(divider) + 2) * _NANOSECONDS_PER_TICK / NANOSECONDS

    def _write_all(self, register: int, size: int, contents: Iterable[bytes]) -> None:
        for number, content in enumerate(contents):
            self._master.write(self.PALM, register + size * number, content)

    def _exchange_zeros(self, image: PalmImage) -> None:
        for _ in range(_FIRST_EXCHANGES):
            if self._master.ask(image_telegram(image, bytes(image.command_bytes))).working_counter:
                return
            self._master.wait(0.001)
        hint = "Switch the hand off and on, and connect again"
        raise self._wrong(f"the palm accepted no process image in {_FIRST_EXCHANGES} tries", hint)

    def _wrong(self, what: str, hint: str) -> DeviceError:
        return DeviceError(what, where=self._master.where, hint=hint)


def image_telegram(image: PalmImage, command: bytes) -> Telegram:
    """The one telegram of a cycle: the command, and room for the status behind it."""
    return Telegram(Command.LRW, IMAGE_BASE, command + bytes(image.status_bytes))
