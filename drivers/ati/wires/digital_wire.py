"""A Nano17 as a Digital F/T sensor on RS-485: Modbus first, then a raw stream of gauges (protocols: Digital F/T)."""

from __future__ import annotations

from drivers.ati.protocols import modbus
from drivers.ati.protocols.digital_calibration import (
    BLOCK,
    FIRST_REGISTER,
    REGISTERS_EACH,
    DigitalCalibration,
    decode_block,
)
from drivers.ati.protocols.gauge_stream import GaugeStream
from drivers.ati.protocols.modbus import Frame
from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.wire import GaugeSamples, spread_stamps
from drivers.core.contacts import Array
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, Transport
from drivers.force.force_fingertip import WrenchSample

BAUD_RATES = (1_250_000, 115_200, 19_200)
STATUS_REGISTER = 0x001D
JAM = b"\x00" * 16
"""Any 14 or more bytes end a stream."""

STATUS_BITS = {
    1: "watchdog",
    2: "gauge excitation too high",
    4: "gauge excitation too low",
    8: "artificial analog ground out of range",
    16: "supply voltage too high",
    32: "supply voltage too low",
    128: "EEPROM failure",
    256: "configuration invalid",
    512: "gauge bridge supply current too high",
    1024: "gauge bridge supply current too low",
    2048: "thermistor too high",
    4096: "thermistor too low",
    8192: "converter out of range",
}
"""What the bits of the status word mean, by their value."""

_ANSWER_s, _QUIET_s = 0.25, 0.05
_FIRST_READ = 96  # registers; a block needs two reads, whose lengths differ so that their replies can be told apart
_PIECE_ns = 50_000_000


def describe_status(status: int) -> tuple[str, ...]:
    """A status word in plain English; empty if healthy."""
    unnamed = status & ~sum(STATUS_BITS)
    words = [text for bit, text in STATUS_BITS.items() if status & bit]
    return (*words, f"undocumented status bits 0x{unnamed:04x}") if unnamed else tuple(words)


class DigitalWire:
    """The RS-485 line of one sensor.

    Args:
        slot: which of the sensor's calibrations, from 1.
        serial: of the sensor; "" for any.

    Attributes:
        calibration: as read from the sensor; None until then.
    """

    stuck_after = 100
    step = 0

    def __init__(self, slot: int = 1, serial: str = "") -> None:
        self.calibration: DigitalCalibration | None = None
        self._slot, self._serial = slot, serial
        self._samples = GaugeSamples(limit=32767)
        self._first = FIRST_REGISTER + REGISTERS_EACH * (slot - 1)
        self._restart()

    @property
    def ranges_SI(self) -> Array | None:
        """Calibrated range of each axis, N and N m, shape (6,)."""
        return None if self.calibration is None else self.calibration.ranges_SI

    def start(self, talk: Conversation) -> None:
        """End an old stream, read status and calibration, and start the stream.

        Raises:
            DeviceError: the sensor does not answer, is faulty, is not the expected one, or does not stream.
        """
        self._restart()
        talk.send(JAM)
        talk.wait(_QUIET_s)
        self._buffer.clear()
        status = int.from_bytes(self._read(talk, STATUS_REGISTER, 1), "big")
        if problems := describe_status(status):
            raise DeviceError(f"the sensor reports: {'; '.join(problems)}", where=talk.name, hint="Check its supply")
        registers = BLOCK.size // 2
        self._read(talk, self._first, _FIRST_READ)
        self._read(talk, self._first + _FIRST_READ, registers - _FIRST_READ)
        self._check_calibration(talk.name)
        self._ask(talk, Frame(modbus.SLAVE, modbus.START_STREAM, b"\x55"))
        if not self._streaming:
            raise DeviceError("the sensor refuses to stream", where=talk.name, hint="Switch it off and on")

    def ask(self, transport: Transport, now_ns: int) -> None:
        """Do nothing: the sensor streams."""

    def stop(self, transport: Transport) -> None:
        """End the stream. Raises DeviceError."""
        transport.send(JAM)

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one chunk of received bytes: replies during set-up, samples once the sensor streams.

        Raises:
            CodecError: the received values cannot be a calibration.
        """
        piece = datagram.payload
        if not self._streaming:
            piece = self._take_replies(piece)
        return self._decode(piece, datagram.stamp_ns) if self._streaming else []

    def health(self) -> tuple[str, ...]:
        """Lost bytes, in plain English."""
        stream = self._stream
        if not stream.skipped_bytes:
            return ()
        return (f"{stream.skipped_bytes} bytes do not belong to any sample; realigned {stream.resyncs} times",)

    def _restart(self) -> None:
        self._buffer, self._stream, self._streaming = bytearray(), GaugeStream(), False
        self._replies: list[Frame] = []
        self._head = b""
        self._arrived_ns: int | None = None

    def _take_replies(self, piece: bytes) -> bytes:
        """Remove replies from the received bytes; what follows the reply to the start request belongs to the stream."""
        self._buffer += piece
        while (reply := modbus.take_reply(self._buffer)) is not None:
            self._replies = [reply]
            self._learn(reply)
            if reply.function == modbus.START_STREAM and reply.data == b"\x01":
                rest, self._streaming = bytes(self._buffer), True
                self._buffer.clear()
                return rest
        return b""

    def _learn(self, reply: Frame) -> None:
        """Combine the two parts of the calibration."""
        if reply.function != modbus.READ_HOLDING:
            return
        data = reply.data[1:]
        if len(data) == 2 * _FIRST_READ:
            self._head = data
        elif self._head and len(data) == BLOCK.size - 2 * _FIRST_READ:
            self.calibration, self._head = decode_block(self._head + data), b""

    def _decode(self, piece: bytes, stamp_ns: int) -> list[WrenchSample]:
        gauges, errors, lost = self._stream.feed(piece)
        self._samples.skip(lost)
        stamps_ns = spread_stamps(self._arrived_ns, stamp_ns, len(gauges), _PIECE_ns)
        self._arrived_ns = stamp_ns
        if self.calibration is None:
            raise CodecError("the stream began before the sensor's calibration was read", where="digital sensor")
        faults = ["the sensor reports a status error" if error else "" for error in errors]
        return self._samples.make(gauges, self.calibration.working_matrix, stamps_ns, faults)

    def _read(self, talk: Conversation, first: int, count: int) -> bytes:
        reply = self._ask(talk, modbus.read_request(first, count))
        if len(reply.data) != 1 + 2 * count:
            raise DeviceError(f"register 0x{first:04x} cannot be read", where=talk.name, hint="Is it a Digital F/T?")
        return reply.data[1:]

    def _ask(self, talk: Conversation, request: Frame) -> Frame:
        """Ask up to three times. Raises DeviceError when no valid reply comes."""
        for _ in range(3):
            self._replies = []
            talk.send(modbus.encode(request))
            reply = talk.until(lambda: self._replies[-1] if self._replies else None, _ANSWER_s)
            if reply is not None and not reply.exception:
                return reply
        if reply is not None:
            raise DeviceError(f"the sensor refuses ({reply.exception})", where=talk.name, hint="Is it a Digital F/T?")
        raise DeviceError(
            "the sensor does not answer",
            where=talk.name,
            hint="Check power, A and B wires, baud rate (1250000, 115200 or 19200) and even parity",
        )

    def _check_calibration(self, where: str) -> None:
        if self.calibration is None:
            raise DeviceError(
                f"calibration {self._slot} of the sensor is not usable", where=where, hint="Choose another slot"
            )
        if self._serial and self.calibration.serial != self._serial:
            raise DeviceError(
                f"the sensor is {self.calibration.serial}, but the rig file names {self._serial}",
                where=where,
                hint="Swap the cables, or correct the rig file",
            )
