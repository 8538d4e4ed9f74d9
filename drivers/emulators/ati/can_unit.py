"""An emulated Net CAN OEM board, without its bus (protocols: Net CAN OEM)."""

from __future__ import annotations

from drivers.ati.protocols import can_codec
from drivers.ati.protocols.can_codec import DEFAULT_BASE, Op
from drivers.ati.protocols.digital_calibration import FORCE_UNITS, TORQUE_UNITS
from drivers.core.errors import CodecError
from drivers.emulators.ati.sensor import EmulatedSensor
from drivers.hardware.can_bus import CanFrame, decode_frame, encode_frame


class CanUnit:
    """One board; it sends only on request.

    Args:
        sensor: the transducer behind it.
        base: upper part of its identifiers.

    Attributes:
        status: status word of its readings.
        sent: readings sent.
    """

    rate_hz = 1.0

    def __init__(self, sensor: EmulatedSensor | None = None, base: int = DEFAULT_BASE) -> None:
        self.sensor = sensor or EmulatedSensor()
        self.status = self.sent = 0
        self._base, self._slot = base, 0

    def handle(self, payload: bytes) -> list[bytes]:
        """Process one frame; frames for other boards and unknown ones get no answer."""
        try:
            frame = decode_frame(payload)
            base, op = can_codec.split_identifier(frame.identifier)
        except CodecError:
            return []
        return [encode_frame(answer) for answer in self._answers(op, frame.data)] if base == self._base else []

    def tick(self) -> bytes | None:
        """None: a board does not stream."""
        return None

    def _answers(self, op: Op, data: bytes) -> list[CanFrame]:
        calibration = self.sensor.calibration
        if op == Op.GAUGES:
            self.sent += 1
            return list(can_codec.encode_gauges(self.status, self.sensor.gauges(), self._base))
        if op == Op.MATRIX and len(data) == 1 and data[0] < 6:
            return self._row(data[0])
        answers = {
            Op.SERIAL: calibration.serial.encode("ascii").ljust(8, b"\0"),
            Op.SELECT_CALIBRATION: data,
            Op.COUNTS_PER_UNIT: can_codec.encode_counts(calibration.counts_per_force, calibration.counts_per_torque),
            Op.UNITS: bytes(
                (FORCE_UNITS.index(calibration.force_unit) + 1, TORQUE_UNITS.index(calibration.torque_unit) + 1)
            ),
            Op.FIRMWARE: b"\x01\x00\x00\x01",
        }
        return [can_codec.request(op, answers[op], self._base)] if op in answers else []

    def _row(self, axis: int) -> list[CanFrame]:
        row = self.sensor.calibration.matrix[axis].tolist()
        return [
            can_codec.request(Op(Op.MATRIX + part), can_codec.encode_pair(*row[2 * part : 2 * part + 2]), self._base)
            for part in range(3)
        ]
