"""An EtherCAT master on raw frames: exchanges telegrams, and reads and writes the registers of single slaves.

Every frame carries a sequence number in its source address, as in Shadow's master. Only a frame with the number just
sent is accepted as the answer; frames that come back late after a stall are counted and discarded.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import Field

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.configuration import StrictModel
from drivers.core.errors import CodecError, DeviceError
from drivers.ethercat.frames import Command, Telegram, decode_frame, encode_frame, physical, source_of
from drivers.ethercat.ports import Port
from drivers.ethercat.registers import AL_ERROR, DEVICE_EMULATION, AlState, AlStatus, Register

_INDICES, _NUMBERS = 0x100, 0x10000
_EEPROM_READ, _EEPROM_BUSY, _EEPROM_ERRORS = 0x0100, 0x8000, 0x7800
_SETTLING_s = 0.01
"""Shadow's master waits this long after a change of state, and before it checks a busy EEPROM again."""


class MasterSettings(StrictModel):
    """Time limits of the master.

    Attributes:
        answer_s: a cyclic frame that has not come back after this time counts as lost, seconds.
        setup_answer_s: the same while the ring is set up.
        tries: how often a frame is sent during set-up before the ring counts as silent.
        state_tries: how often a slave's state is read while it changes, 10 ms apart.
        eeprom_tries: how often a busy EEPROM is read again, 10 ms apart.
    """

    answer_s: float = Field(default=0.001, gt=0.0, le=0.1)
    setup_answer_s: float = Field(default=0.02, gt=0.0, le=1.0)
    tries: int = Field(default=3, ge=1)
    state_tries: int = Field(default=20, ge=1)
    eeprom_tries: int = Field(default=100, ge=1)


@dataclass
class FrameCounts:
    """Frames since the port was opened.

    Attributes:
        sent: all frames sent.
        lost: did not come back in time.
        stale: came back too late and were discarded.
        damaged: came back, but could not be decoded.
    """

    sent: int = 0
    lost: int = 0
    stale: int = 0
    damaged: int = 0


class EtherCatMaster:
    """Sends telegrams and receives their answers.

    Args:
        port: the network port.
        clock: for time-outs and waits.
        settings: time limits.
    """

    def __init__(self, port: Port, clock: Clock, settings: MasterSettings | None = None) -> None:
        self._port, self._clock, self.settings = port, clock, settings or MasterSettings()
        self._index = self._number = 0
        self._waiting: tuple[tuple[Telegram, ...], bytes] | None = None
        self.counts = FrameCounts()

    @property
    def where(self) -> str:
        """The interface, for messages."""
        return self._port.name

    def open(self) -> None:
        """Open the port. Raises DeviceError."""
        self._port.open()
        self.counts = FrameCounts()
        self._waiting = None

    def close(self) -> None:
        """Close the port; idempotent."""
        self._port.close()
        self._waiting = None

    def wait(self, duration_s: float) -> None:
        """Give the slaves time."""
        self._clock.sleep_until_ns(self._clock.now_ns() + round(duration_s * NANOSECONDS))

    # --- frames ------------------------------------------------------------------------------------------------

    def start(self, telegrams: Sequence[Telegram]) -> None:
        """Send telegrams in one frame; :meth:`finish` receives the answer."""
        self._number = (self._number + 1) % _NUMBERS
        self._index = (self._index + 1) % _INDICES
        numbered = tuple(Telegram(each.command, each.address, each.data, self._index) for each in telegrams)
        source = self._port.hardware_address[:3] + b"\0" + self._number.to_bytes(2, "little")
        self._waiting = (numbered, source)
        self.counts.sent += 1
        self._port.send(encode_frame(numbered, source))

    def finish(self, timeout_s: float) -> tuple[Telegram, ...] | None:
        """The answers to the last frame, in order; None if it was lost or nothing was sent."""
        if self._waiting is None:
            return None
        (requests, source), self._waiting = self._waiting, None
        deadline_ns = self._clock.now_ns() + round(timeout_s * NANOSECONDS)
        while (frame := self._port.receive((deadline_ns - self._clock.now_ns()) / NANOSECONDS)) is not None:
            if source_of(frame)[1:] != source[1:]:  # the first byte's local bit is set by the first slave
                self.counts.stale += 1
            elif (answers := self._answers(frame, requests)) is not None:
                return answers
        self.counts.lost += 1
        return None

    def _answers(self, frame: bytes, requests: tuple[Telegram, ...]) -> tuple[Telegram, ...] | None:
        try:
            answers = decode_frame(frame)
        except CodecError:
            answers = ()
        if len(answers) == len(requests) and all(map(Telegram.answers, answers, requests)):
            return answers
        self.counts.damaged += 1
        return None

    def ask(self, telegram: Telegram) -> Telegram:
        """Send one telegram and return its answer; sent again if it is lost.

        Raises:
            DeviceError: nothing comes back.
        """
        for _ in range(self.settings.tries):
            self.start((telegram,))
            if (answers := self.finish(self.settings.setup_answer_s)) is not None:
                return answers[0]
        raise DeviceError("no EtherCAT frame comes back", where=self.where, hint="Check the hand's power and its cable")

    # --- registers ---------------------------------------------------------------------------------------------

    def count_slaves(self) -> int:
        """Number of slaves: each adds one to the position field of a passing telegram."""
        return self.ask(Telegram(Command.APRD, physical(0, Register.INFORMATION), bytes(1))).slave

    def broadcast(self, register: int, data: bytes) -> int:
        """Write the same bytes to all slaves; returns how many accepted them."""
        return self.ask(Telegram(Command.BWR, physical(0, register), data)).working_counter

    def read(self, slave: Slave, register: int, length: int) -> bytes:
        """Read registers of one slave.

        Raises:
            DeviceError: the slave does not answer.
        """
        command = Command.FPRD if slave.station else Command.APRD
        return self._accept(Telegram(command, physical(slave.address, register), bytes(length)), slave)

    def write(self, slave: Slave, register: int, data: bytes) -> None:
        """Write registers of one slave.

        Raises:
            DeviceError: the slave does not answer.
        """
        command = Command.FPWR if slave.station else Command.APWR
        self._accept(Telegram(command, physical(slave.address, register), data), slave)

    def _accept(self, telegram: Telegram, slave: Slave) -> bytes:
        for _ in range(self.settings.tries):
            if (answer := self.ask(telegram)).working_counter == 1:
                return answer.data
        what = f"slave {slave.position} does not answer at register 0x{telegram.register:04X}"
        raise DeviceError(what, where=self.where, hint="Switch the hand off and on, and connect again")

    # --- identity and state of a slave -----------------------------------------------------------------------

    def read_eeprom(self, slave: Slave, word: int) -> int:
        """The 32 bits at a word address of a slave's EEPROM.

        Raises:
            DeviceError: the EEPROM stays busy or reports an error.
        """
        self.write(slave, Register.EEPROM_CONTROL, struct.pack("<HI", _EEPROM_READ, word))
        for _ in range(self.settings.eeprom_tries):
            control, value = struct.unpack("<H4xI", self.read(slave, Register.EEPROM_CONTROL, 10))
            if not control & _EEPROM_BUSY:
                if control & _EEPROM_ERRORS:
                    raise self._eeprom_error(slave, f"reports an error (0x{control:04X})")
                return int(value)
            self.wait(_SETTLING_s)
        raise self._eeprom_error(slave, "stays busy")

    def _eeprom_error(self, slave: Slave, what: str) -> DeviceError:
        hint = "Switch the hand off and on; if the error remains, the board needs service"
        return DeviceError(f"the EEPROM of slave {slave.position} {what}", where=self.where, hint=hint)

    def al_status(self, slave: Slave) -> AlStatus:
        """The state that a slave reports."""
        return AlStatus.decode(self.read(slave, Register.AL_STATUS, AlStatus.SIZE))

    def change_state(self, slave: Slave, state: AlState) -> None:
        """Bring a slave to a state; like Shadow's master, acknowledge an error only if the slave shows one.

        A slave in device emulation copies the request into its status (protocols: Slave registers). An acknowledgement
        would look like an error from then on, and whatever looks like an error disappears with the next request.

        Raises:
            DeviceError: it refuses, with its reason in plain English, or does not reach the state in time.
        """
        stands = self.al_status(slave).error and not self._copies_requests(slave)
        acknowledge = AL_ERROR if stands else 0
        self.write(slave, Register.AL_CONTROL, struct.pack("<H", state | acknowledge))
        for _ in range(self.settings.state_tries):
            self.wait(_SETTLING_s)
            if (status := self.al_status(slave)).state == state and not status.error:
                return
            if status.error:
                break
        what = f"slave {slave.position} does not enter {state.name}: it is in {status}"
        raise DeviceError(what, where=self.where, hint="Switch the hand off and on, and connect again")

    def _copies_requests(self, slave: Slave) -> bool:
        """Whether a slave is in device emulation."""
        return bool(self.read(slave, Register.ESC_CONFIGURATION, 1)[0] & DEVICE_EMULATION)


@dataclass(frozen=True)
class Slave:
    """One slave in the ring.

    Attributes:
        position: 0 for the first after the master.
        station: the address assigned to it; 0 while it has none and is addressed by its position.
    """

    position: int
    station: int = 0

    @property
    def address(self) -> int:
        """Its address in telegrams: the station address, or minus its position."""
        return self.station or -self.position
