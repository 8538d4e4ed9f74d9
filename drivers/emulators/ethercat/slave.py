"""An emulated slave controller as seen by an EtherCAT master: registers, EEPROM, FMMUs, SyncManagers, states, watchdog.

Modelled on Beckhoff's ET1200 with 1 KiB of process memory. Only what the hand uses is emulated: FMMUs map whole bytes
and SyncManagers have one buffer; other settings are refused on the way to SAFEOP. There is no mailbox and there are no
distributed clocks.
"""

from __future__ import annotations

import struct
from dataclasses import replace

from drivers.core.clock import Clock
from drivers.emulators.ethercat.eeprom import EepromInterface
from drivers.emulators.ethercat.guarded_memory import RAM_END, RAM_KIB, RAM_START, SYNC_MANAGERS, Block, GuardedMemory
from drivers.emulators.ethercat.slave_application import Application, NoApplication, Service, SlaveCounts
from drivers.emulators.ethercat.states import CopiedStates, StateMachine
from drivers.ethercat.frames import Command, Telegram, physical
from drivers.ethercat.registers import DEVICE_EMULATION, FMMU_BYTES, AlState, AlStatus, Register

_FMMUS = 3
_READ_ONLY = (range(0x0010), range(0x0110, 0x0112), range(0x0130, 0x0142), range(0x0440, 0x0442))
_CLEARED_BY_WRITES = (range(0x0300, 0x0308), range(0x0310, 0x0314))
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
        application: the processor behind it; None for device emulation, where there is none.
        clock: for the watchdog and the application's time.
        eeprom_busy: how often a read shows the EEPROM busy after each request.

    Attributes:
        fixed: registers that ignore writes.
    """

    def __init__(self, eeprom: bytes, application: Application | None, clock: Clock, eeprom_busy: int = 1) -> None:
        self._emulates = application is None
        self.application, self._clock = application or NoApplication(), clock
        self.eeprom = EepromInterface(eeprom, eeprom_busy)
        self.counts, self.fixed = SlaveCounts(), list[int]()
        self._power_up()

    def _power_up(self) -> None:
        self._memory = bytearray(RAM_END)
        self._memory[:9] = bytes((0x12, 0, 0, 0, _FMMUS, SYNC_MANAGERS, RAM_KIB, 0x0F, 0x00))
        struct.pack_into("<H", self._memory, Register.DL_STATUS, 0x5611)
        struct.pack_into("<H", self._memory, Register.WATCHDOG_DIVIDER, _DIVIDER)
        struct.pack_into("<H", self._memory, Register.WATCHDOG_TIME_PDI, _WATCHDOG_TICKS)
        struct.pack_into("<H", self._memory, Register.WATCHDOG_TIME, _WATCHDOG_TICKS)
        self._fmmus: list[tuple[int, int, int, int]] = []
        self._ram = GuardedMemory(self._memory, self.counts, self._fill)
        self._load_watchdog()
        self._memory[Register.ESC_CONFIGURATION] = DEVICE_EMULATION if self._emulates else 0
        self._states = CopiedStates() if self._emulates else StateMachine(self._setup_error)
        self._service: Service | None = None
        self._fed_ns = 0

    def power_cycle(self) -> None:
        """Reset everything but the EEPROM."""
        self._power_up()

    @property
    def al_status(self) -> AlStatus:
        """State and error."""
        return self._states.status

    def fall_to(self, state: AlState, code: int) -> None:
        """Let the slave leave its state by itself, with an error."""
        self._states.fall(state, code)

    def count_damage(self, port: int) -> None:
        """Count a frame that arrived damaged."""
        self._count(Register.ERROR_COUNTERS + 2 * port)

    def count_lost_link(self, port: int) -> None:
        """Count a lost link of a port."""
        self._count(Register.LOST_LINKS + port)

    def _count(self, register: int) -> None:
        self._memory[register] = min(self._memory[register] + 1, 0xFF)

    # --- telegrams ---------------------------------------------------------------------------------------------

    def process(self, telegram: Telegram) -> Telegram:
        """Process a telegram; returns it as it leaves this slave."""
        self._catch_up()
        command = telegram.command
        if command in _LOGICAL:
            return self._logical(telegram) if self._fmmus else telegram
        passed = telegram
        if command in _BY_POSITION or command in _TO_ALL:
            passed = replace(telegram, address=physical(telegram.slave + 1, telegram.register))
        mine = command in _TO_ALL or self._is_addressed(telegram)
        if command in (Command.ARMW, Command.FRMW):
            command = (Command.APRD if command is Command.ARMW else Command.FPRD) if mine else Command.BWR
        elif not mine:
            return passed
        return self._physical(passed, command)

    def _is_addressed(self, telegram: Telegram) -> bool:
        if telegram.command in _BY_POSITION:
            return telegram.slave == 0
        host, alias = struct.unpack_from("<2H", self._memory, Register.STATION_ADDRESS)
        alias_used = bool(self._memory[Register.DL_CONTROL + 3] & 1)
        return telegram.command in _BY_STATION and (telegram.slave == host or (alias_used and telegram.slave == alias))

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
        if end > RAM_END:
            return None
        if end > RAM_START:
            return self._ram.read(address, end)
        if address <= Register.EEPROM_CONTROL < end:
            self.eeprom.look(self._memory)
        self._memory[Register.AL_STATUS : Register.AL_STATUS + AlStatus.SIZE] = self._states.status.encode()
        return bytes(self._memory[address:end])

    def _write(self, address: int, data: bytes) -> bool:
        end = address + len(data)
        if end > RAM_END:
            return False
        if end > RAM_START:
            return self._ram.write(address, data)
        if any(address in each for each in _READ_ONLY):
            return False
        if address in self.fixed:
            return True
        if cleared := next((each for each in _CLEARED_BY_WRITES if address in each), None):
            data, address, end = bytes(len(cleared)), cleared.start, cleared.stop
        self._memory[address:end] = data
        self._react(address, end)
        return True

    def _fill(self, block: Block) -> None:
        now_ns = self._clock.now_ns()
        if block.number == 0:
            self.counts.commands += 1
            self._service = Service(self.application, now_ns)
        if block.watched:
            self._fed_ns = now_ns

    # --- registers with side effects ---------------------------------------------------------------------------

    def _react(self, address: int, end: int) -> None:
        if address < Register.FMMU + 0x100 and end > Register.FMMU:
            self._load_fmmus()
        if address < Register.SYNC_MANAGER + 0x80 and end > Register.SYNC_MANAGER:
            self._ram.load()
            self._load_watchdog()
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

    def _load_watchdog(self) -> None:
        """Time without process data after which the slave leaves OP; 0 if no SyncManager is watched."""
        (divider,) = struct.unpack_from("<H", self._memory, Register.WATCHDOG_DIVIDER)
        (ticks,) = struct.unpack_from("<H", self._memory, Register.WATCHDOG_TIME)
        self._watchdog_ns = (divider + 2) * _TICK_ns * ticks if self._ram.watched else 0

    def _request_state(self) -> None:
        before = self._states.status.state
        self._states.request(self._memory[Register.AL_CONTROL])
        now = self._states.status.state
        if before < AlState.SAFEOP <= now:
            self._service = None
            self._ram.publish(self.application.start())
        if now == AlState.OP and before != AlState.OP:
            self._fed_ns = self._clock.now_ns()

    def _setup_error(self) -> bool | None:
        """What is missing in the SyncManagers for the application: None nothing, True outputs, False inputs."""
        return self._ram.missing(self.application.sync_managers)

    # --- the slave's own side ----------------------------------------------------------------------------------

    @property
    def due_ns(self) -> int | None:
        """When the last command needs more work; None if all is done."""
        return None if self._service is None else self._service.due_ns

    def work(self) -> None:
        """Work between two frames: the application processes its command, and the watchdog checks the time."""
        if self._service is not None:
            self._compute(self._service)
        self._catch_up()

    def _catch_up(self) -> None:
        """Do all that is due by now: finish the application's cycle, and check the watchdog."""
        now_ns = self._clock.now_ns()
        if self._service is not None and now_ns >= self._service.over_ns:
            self._show(self._service)
        if self._watchdog_ns and now_ns - self._fed_ns > self._watchdog_ns and self._states.status.state == AlState.OP:
            self.counts.watchdog_trips += 1
            self._states.watchdog()

    def _compute(self, service: Service) -> None:
        if service.looked_at:
            return
        state = self._states.status.state
        running = state >= AlState.SAFEOP
        service.look(self._ram.contents() if running else None, operating=state == AlState.OP)

    def _show(self, service: Service) -> None:
        self._compute(service)
        self._service = None
        self._ram.release()
        if service.answer is not None:
            self._ram.publish(service.answer)
