"""An emulated Digital F/T sensor, without its line: Modbus registers and the raw stream (protocols: Digital F/T)."""

from __future__ import annotations

from drivers.ati.protocols import modbus
from drivers.ati.protocols.digital_calibration import FIRST_REGISTER, encode_block
from drivers.ati.protocols.gauge_stream import encode_sample
from drivers.ati.protocols.modbus import Frame
from drivers.ati.wires.digital_wire import STATUS_REGISTER
from drivers.core.errors import CodecError
from drivers.emulators.ati.sensor import EmulatedSensor

_JAM = 14
_REQUESTS = {modbus.READ_HOLDING: 8, modbus.START_STREAM: 5, modbus.UNLOCK: 5}


class DigitalUnit:
    """One sensor.

    Args:
        sensor: the transducer behind it.
        rate_hz: samples per second while it streams.

    Attributes:
        status: its status word.
        sent: samples sent.
        streaming: whether it streams.
    """

    def __init__(self, sensor: EmulatedSensor | None = None, rate_hz: float = 7000.0) -> None:
        self.sensor = sensor or EmulatedSensor()
        self.rate_hz = rate_hz
        self.status = self.sent = 0
        self.streaming = False
        self._jammed = 0
        self._buffer = b""

    def handle(self, payload: bytes) -> list[bytes]:
        """Process received bytes: during a stream 14 of them end it, otherwise they are requests."""
        if self.streaming:
            self._jammed += len(payload)
            if self._jammed >= _JAM:
                self.streaming, self._jammed, self._buffer = False, 0, b""
            return []
        self._buffer = (self._buffer + payload)[-512:]
        return self._answers()

    def tick(self) -> bytes | None:
        """The next sample."""
        if not self.streaming:
            return None
        self.sent += 1
        return encode_sample(self.sensor.gauges(), status_error=self.status != 0)

    def _answers(self) -> list[bytes]:
        answers = []
        while (request := self._next_request()) is not None:
            answers.append(modbus.encode(self._answer(request)))
        return answers

    def _next_request(self) -> Frame | None:
        """The first valid request in the received bytes; bytes before it are discarded."""
        for start in range(len(self._buffer) - 4):
            length = _REQUESTS.get(self._buffer[start + 1], 8)
            try:
                frame = modbus.decode(self._buffer[start : start + length])
            except CodecError:
                continue
            if frame.slave == modbus.SLAVE:
                self._buffer = self._buffer[start + length :]
                return frame
        return None

    def _answer(self, request: Frame) -> Frame:
        if request.function == modbus.READ_HOLDING:
            first, count = (int.from_bytes(request.data[i : i + 2], "big") for i in (0, 2))
            return self._read(first, count)
        if request.function == modbus.START_STREAM and request.data == b"\x55":
            self.streaming = True
        elif request.function != modbus.UNLOCK:
            return Frame(modbus.SLAVE, request.function | 0x80, b"\x01")
        return Frame(modbus.SLAVE, request.function, b"\x01")

    def _read(self, first: int, count: int) -> Frame:
        """Registers: unknown ones read as zero, addresses beyond the sensor's memory are refused."""
        if not 1 <= count <= 125 or first + count > 0x1000:
            return Frame(modbus.SLAVE, modbus.READ_HOLDING | 0x80, b"\x02")
        memory = bytearray(2 * 0x1000)
        memory[2 * STATUS_REGISTER : 2 * STATUS_REGISTER + 2] = self.status.to_bytes(2, "big")
        block = encode_block(self.sensor.calibration)
        memory[2 * FIRST_REGISTER : 2 * FIRST_REGISTER + len(block)] = block
        data = bytes(memory[2 * first : 2 * (first + count)])
        return Frame(modbus.SLAVE, modbus.READ_HOLDING, bytes([len(data)]) + data)
