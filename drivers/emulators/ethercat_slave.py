"""A slave controller as an EtherCAT master meets it: registers, EEPROM, FMMUs, SyncManagers, states, watchdog.

Modelled on Beckhoff's ET1200 with 1 KiB of process memory. Only what the hand uses is there: FMMUs map whole bytes and
SyncManagers have one buffer; others are refused on the way to SAFEOP. No mailbox, no distributed clocks.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from drivers.emulators.ethercat_eeprom import EepromInterface
from drivers.emulators.ethercat_states import StateMachine
from drivers.emulators.slave_application import Application, Block, Service, SlaveCounts
from drivers.ethercat.frames import Command, Telegram, physical
from drivers.ethercat.registers import FMMU_BYTES, SYNC_MANAGER_BYTES, AlState, AlStatus, Register
from tactile_lab.clock import Clock

_FMMUS, _SYNC_MANAGERS, _RAM_KIB = 3, 4, 1
_RAM_START, _RAM_END = int(Register.PROCESS_RAM), Register.PROCESS_RAM + 1024 * _RAM_KIB
_READ_ONLY = (range(0x0010), range(0x0110, 0x0112), range(0x0130, 0x0136), range(0x0440, 0x0442))
_DIVIDER, _WATCHDOG_TICKS, _TICK_ns = 0x09C2, 1000, 40

_READS = {Command.APRD, Command.APRW, Command.FPRD, Command.FPRW, Command.BRD, Command.BRW}
_WRITES = {Command.APWR, Command.APRW, Command.FPWR, Command.FPRW, Command.BWR, Command.BRW}
_BY_POSITION = {Command.APRD, Command.APWR, Command.APRW, Command.ARMW}
_BY_STATION = {Command.FPRD, Command.FPWR, Command.FPRW, Command.FRMW}
_TO_ALL = {Command.BRD, Command.BWR, Command.BRW}
_LOGICAL = {Command.LRD, Command.LWR, Command.LRW}


class SlaveController:
    """One slave.

    Args:
        eeprom: its content.
        application: what stands behind it.
        clock: for the watchdog and the application's time.
        eeprom_busy: so many looks at the EEPROM see it busy after each request.
    """

    def __init__(self, eeprom: bytes, application: Application, clock: Clock, eeprom_busy: int = 1) -> None:
        self.application, self._clock = application, clock
        self.eeprom = EepromInterface(eeprom, eeprom_busy)
        self.counts = SlaveCounts()
        self._power_up()

    def _power_up(self) -> None:
        self._memory = bytearray(_RAM_END)
        self._memory[:9] = bytes((0x12, 0, 0, 0, _FMMUS, _SYNC_MANAGERS, _RAM_KIB, 0x0F, 0x00))
        struct.pack_into("<H", self._memory, Register.DL_STATUS, 0x5611)
        struct.pack_into("<H", self._memory, Register.WATCHDOG_DIVIDER, _DIVIDER)
        struct.pack_into("<H", self._memory, Register.WATCHDOG_TIME_PDI, _WATCHDOG_TICKS)
        struct.pack_into("<H", self._memory, Register.WATCHDOG_TIME, _WATCHDOG_TICKS)
        self._fmmus: list[tuple[int, int, int, int]] = []
        self._load_blocks(())
        self._states = StateMachine(self._setup_error)
        self._service: Service | None = None
        self._fed_ns = 0

    def power_cycle(self) -> None:
        """Everything is forgotten but the EEPROM."""
        self._power_up()

    @property
    def al_status(self) -> AlStatus:
        """State and error."""
        return self._states.status

    def fall_to(self, state: AlState, code: int) -> None:
        """The slave leaves its state by itself, with an error."""
        self._states.fall(state, code)

    # --- telegrams ---------------------------------------------------------------------------------------------

    def process(self, telegram: Telegram) -> Telegram:
        """A telegram as it leaves this slave."""
        self._catch_up()
        command = telegram.command
        if command in _LOGICAL:
            return self._logical(telegram) if self._fmmus else telegram
        passed = telegram
        if command in _BY_POSITION or command in _TO_ALL:
            passed = replace(telegram, address=physical(telegram.slave + 1, telegram.register))
        mine = command in _TO_ALL or self._named(telegram)
        if command in (Command.ARMW, Command.FRMW):
            command = (Command.APRD if command is Command.ARMW else Command.FPRD) if mine else Command.BWR
        elif not mine:
            return passed
        return self._physical(passed, command)

    def _named(self, telegram: Telegram) -> bool:
        if telegram.command in _BY_POSITION:
            return telegram.slave == 0
        station, alias = struct.unpack_from("<2H", self._memory, Register.STATION_ADDRESS)
        alias_used = bool(self._memory[Register.DL_CONTROL + 3] & 1)
        return telegram.command in _BY_STATION and (
            telegram.slave == station or (alias_used and telegram.slave == alias)
        )

    def _physical(self, telegram: Telegram, command: Command) -> Telegram:
        data, counter = telegram.data, telegram.working_counter
        if command in _READS and (read := self._read(telegram.register, len(data))) is not None:
            both = command in (Command.BRD, Command.BRW)
            data = bytes(old | new for old, new in zip(data, read, strict=True)) if both else read
            counter += 1
        if command in _WRITES and self._write(telegram.register, telegram.data):
            counter += 2 if command in _READS else 1
        return replace(telegram, data=data, working_counter=counter & 0xFFFF)

    def _logical(self, telegram: Telegram) -> Telegram:
        command, data, first = telegram.command, bytearray(telegram.data), telegram.address
        last, wrote, read = first + len(data), False, False
        for logical, length, memory, kind in self._fmmus:
            low, high = max(first, logical), min(last, logical + length)
            if low >= high:
                continue
            at, own = memory + low - logical, slice(low - first, high - first)
            if kind & 2 and command is not Command.LRD:
                wrote |= self._write(at, telegram.data[own])
            if kind & 1 and command is not Command.LWR:
                found = self._read(at, high - low)
                read |= found is not None
                data[own] = found if found is not None else data[own]
        weight = 2 if command is Command.LRW else 1
        counter = telegram.working_counter + weight * wrote + read & 0xFFFF
        return Telegram(command, first, bytes(data), telegram.index, counter, telegram.interrupt, telegram.circulated)

    # --- memory, from the master's side ------------------------------------------------------------------------

    def _read(self, address: int, length: int) -> bytes | None:
        end = address + length
        if end > _RAM_END:
            return None
        if end > _RAM_START:
            return self._read_blocks(address, end)
        if address <= Register.EEPROM_CONTROL < end:
            self.eeprom.look(self._memory)
        self._memory[Register.AL_STATUS : Register.AL_STATUS + AlStatus.SIZE] = self._states.status.encode()
        return bytes(self._memory[address:end])

    def _read_blocks(self, address: int, end: int) -> bytes | None:
        """What unguarded memory and full blocks hold; a block gives itself away with its last byte."""
        found, data = False, bytearray(end - address)
        for low, high, block in self._segments(address, end):
            if block is not None and (block.to_slave or not block.full):
                self.counts.empty += int(not block.to_slave and block.number == self._first_to_master)
                continue
            data[low - address : high - address] = self._memory[low:high]
            found = True
            if block is not None and high == block.end:
                block.full = False
                self.counts.statuses += int(block.number == self._first_to_master)
        return bytes(data) if found else None

    def _write(self, address: int, data: bytes) -> bool:
        end = address + len(data)
        if end > _RAM_END:
            return False
        if end > _RAM_START:
            return self._write_blocks(address, data)
        if any(address in each for each in _READ_ONLY):
            return False
        self._memory[address:end] = data
        self._react(address, end)
        return True

    def _write_blocks(self, address: int, data: bytes) -> bool:
        taken = False
        for low, high, block in self._segments(address, address + len(data)):
            if block is not None and (not block.to_slave or block.full):
                self.counts.refused += int(block.to_slave and block.number == 0)
                continue
            self._memory[low:high] = data[low - address : high - address]
            taken = True
            if block is not None and high == block.end:
                self._filled(block)
        return taken

    def _filled(self, block: Block) -> None:
        block.full = True
        now_ns = self._clock.now_ns()
        if block.number == 0:
            self.counts.commands += 1
            self._service = Service(self.application, now_ns)
        if block.watched:
            self._fed_ns = now_ns

    def _segments(self, address: int, end: int) -> list[tuple[int, int, Block | None]]:
        """An address range cut at the borders of the guarded blocks; kept, as every cycle asks for the same."""
        if (known := self._cuts.get((address, end))) is None:
            borders = {address, end}
            borders |= {edge for block in self._blocks for edge in (block.start, block.end) if address < edge < end}
            known = self._cuts[address, end] = [
                (low, high, next((block for block in self._blocks if block.start <= low < block.end), None))
                for low, high in pairwise(sorted(borders))
            ]
        return known

    # --- registers that do something ---------------------------------------------------------------------------

    def _react(self, address: int, end: int) -> None:
        if address < Register.FMMU + 0x100 and end > Register.FMMU:
            self._load_fmmus()
        if address < Register.SYNC_MANAGER + 0x80 and end > Register.SYNC_MANAGER:
            self._load_blocks(self._blocks)
        if address < Register.WATCHDOG_STATUS and end > Register.WATCHDOG_DIVIDER:
            self._load_watchdog()
        if address <= Register.AL_CONTROL < end:
            self._request_state()
        if address <= Register.EEPROM_CONTROL + 1 < end:
            self.eeprom.request()

    def _load_fmmus(self) -> None:
        self._fmmus = []
        for number in range(_FMMUS):
            fields = struct.unpack_from("<IHBBHBBB", self._memory, Register.FMMU + FMMU_BYTES * number)
            logical, length, first_bit, last_bit, memory, bit, kind, active = fields
            if active & 1 and length and (first_bit, last_bit, bit) == (0, 7, 0):
                self._fmmus.append((logical, length, memory, kind))

    def _load_blocks(self, before: Sequence[Block]) -> None:
        full = {(block.number, block.start, block.end) for block in before if block.full}
        blocks = (self._block(number) for number in range(_SYNC_MANAGERS))
        self._blocks = [block for block in blocks if block is not None]
        for block in self._blocks:
            block.full = (block.number, block.start, block.end) in full
        self._inward = [block for block in self._blocks if block.to_slave]
        self._outward = [block for block in self._blocks if not block.to_slave]
        self._first_to_master = self._outward[0].number if self._outward else -1
        self._cuts: dict[tuple[int, int], list[tuple[int, int, Block | None]]] = {}
        self._load_watchdog()

    def _block(self, number: int) -> Block | None:
        """What a SyncManager guards; None when it is off."""
        at = Register.SYNC_MANAGER + SYNC_MANAGER_BYTES * number
        start, length, control, _, active = struct.unpack_from("<HHBBB", self._memory, at)
        if not (active & 1 and length):
            return None
        return Block(number, start, start + length, bool(control & 0x04), bool(control & 0x40), control & 3 == 2)

    def _load_watchdog(self) -> None:
        """Time without a fed SyncManager after which the slave leaves OP; 0 where nothing is watched."""
        (divider,) = struct.unpack_from("<H", self._memory, Register.WATCHDOG_DIVIDER)
        (ticks,) = struct.unpack_from("<H", self._memory, Register.WATCHDOG_TIME)
        self._watchdog_ns = (divider + 2) * _TICK_ns * ticks if any(block.watched for block in self._blocks) else 0

    def _request_state(self) -> None:
        before = self._states.status.state
        self._states.request(self._memory[Register.AL_CONTROL])
        now = self._states.status.state
        if before < AlState.SAFEOP <= now:
            self._service = None
            self._publish(self.application.start())
        if now == AlState.OP and before != AlState.OP:
            self._fed_ns = self._clock.now_ns()

    def _setup_error(self) -> bool | None:
        """What the application misses in the SyncManagers: None nothing, True outputs, False inputs."""
        there = {(block.start, block.end - block.start, block.to_slave) for block in self._blocks if block.one_buffer}
        for wanted in self.application.sync_managers:
            if (wanted.start, wanted.length, wanted.to_slave) not in there:
                return wanted.to_slave
        return None

    # --- the slave's own side ----------------------------------------------------------------------------------

    @property
    def due_ns(self) -> int | None:
        """When there is something to do about the last command; None when all is done."""
        return None if self._service is None else self._service.due_ns

    def work(self) -> None:
        """Between two frames: the application looks at its command, the watchdog at the time."""
        if self._service is not None:
            self._compute(self._service)
        self._catch_up()

    def _catch_up(self) -> None:
        """What is over by now: the application's turn, the watchdog's time."""
        now_ns = self._clock.now_ns()
        if self._service is not None and now_ns >= self._service.over_ns:
            self._show(self._service)
        if self._watchdog_ns and now_ns - self._fed_ns > self._watchdog_ns and self._states.status.state == AlState.OP:
            self.counts.watchdog_trips += 1
            self._states.watchdog()

    def _compute(self, service: Service) -> None:
        state = self._states.status.state
        if state >= AlState.SAFEOP and not service.computed:
            taken = tuple(bytes(self._memory[block.start : block.end]) for block in self._inward)
            service.compute(taken, operating=state == AlState.OP)

    def _show(self, service: Service) -> None:
        self._compute(service)
        self._service = None
        for block in self._inward:
            block.full = False
        if service.answer is not None:
            self._publish(service.answer)

    def _publish(self, contents: tuple[bytes, ...]) -> None:
        for block, content in zip(self._outward, contents, strict=True):
            if not block.full:
                self._memory[block.start : block.end] = content
                block.full = True
