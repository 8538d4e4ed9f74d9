"""A Nano17 on a Net CAN OEM board: calibration is read once, gauges on each request (protocols: Net CAN OEM)."""

from __future__ import annotations

import numpy as np

from drivers.ati.protocols import can_codec
from drivers.ati.protocols.can_codec import DEFAULT_BASE, Op
from drivers.ati.protocols.digital_calibration import DigitalCalibration, check_matrix, unit_names
from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.wire import GAUGES, GaugeSamples, Turn
from drivers.core.contacts import Array
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, Transport
from drivers.force.force_fingertip import WrenchSample
from drivers.hardware.can_bus import decode_frame, encode_frame

_ANSWER_s = 0.1
_TRIES = 3


class _Lesson:
    """The answers to one round of questions about the calibration, in the order in which they are asked."""

    def __init__(self, serial: str) -> None:
        self.serial = serial
        self.elements: list[float] = []
        self.in_order = True
        self.counts: tuple[int, int] | None = None

    def row_part(self, op: Op, pair: tuple[float, float]) -> None:
        """Take a third of a row; a part that arrives out of order invalidates the transfer."""
        expected = (Op.MATRIX, Op.MATRIX_SECOND, Op.MATRIX_THIRD)[len(self.elements) // 2 % 3]
        self.in_order = self.in_order and op == expected
        self.elements += pair

    def finish(self, units: bytes) -> DigitalCalibration | None:
        """The calibration; None if an answer is missing. Raises CodecError if the values cannot be a calibration."""
        if not self.in_order or len(self.elements) != GAUGES * 6 or self.counts is None or len(units) != 2:
            return None
        matrix = np.array(self.elements).reshape(6, GAUGES)
        check_matrix(matrix, *self.counts, "CAN board")
        return DigitalCalibration(self.serial, "", matrix, *unit_names(*units), *self.counts, np.full(6, np.nan))


class CanWire:
    """The CAN messages of one board.

    Args:
        base: upper part of its identifiers.
        slot: which of its calibrations, from 0.
        serial: of the sensor; "" for any.

    Attributes:
        calibration: as read from the board; None until then.
        lost: readings with one of their two frames missing.
    """

    stuck_after = 100
    step = 0
    ranges_SI: Array | None = None

    def __init__(self, base: int = DEFAULT_BASE, slot: int = 0, serial: str = "") -> None:
        self.calibration: DigitalCalibration | None = None
        self.lost = 0
        self._base, self._slot, self._serial = base, slot, serial
        self._samples, self._turn = GaugeSamples(limit=32767), Turn(patience_s=0.1)
        self._lesson: _Lesson | None = None
        self._half: tuple[int, tuple[int, int, int]] | None = None
        self._answers: dict[Op, int] = {}

    def start(self, talk: Conversation) -> None:
        """Choose the calibration and read it.

        Raises:
            DeviceError: the board does not answer, or carries another sensor or an unusable calibration.
        """
        self.calibration, self._half = None, None
        self._turn.restart()
        for _ in range(_TRIES):
            answered = self._learn_all(talk)
            if self.calibration is not None:
                return self._check_serial(talk.name, self.calibration.serial)
        if not answered:
            raise DeviceError(
                f"no board answers at base identifier 0x{self._base:x}",
                where=talk.name,
                hint="Check power, wiring, both terminators and the bit rate (250000 unless changed)",
            )
        raise DeviceError(f"calibration {self._slot} of the board is not usable", where=talk.name, hint="Check the bus")

    def ask(self, transport: Transport, now_ns: int) -> None:
        """Request the next reading, once the previous one has arrived. Raises DeviceError."""
        if self._turn.mine(now_ns):
            transport.send(self._question(Op.GAUGES))

    def stop(self, transport: Transport) -> None:
        """Do nothing: the board sends only on request."""

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one frame; the second frame of a reading completes its sample.

        Raises:
            CodecError: a frame of another board, or of no board.
        """
        frame = decode_frame(datagram.payload)
        base, op = can_codec.split_identifier(frame.identifier)
        if base != self._base:
            raise CodecError(f"identifier 0x{frame.identifier:03x} belongs to another board", where="CAN")
        self._answers[op] = self._answers.get(op, 0) + 1
        if op == Op.GAUGES:
            self._take_first(frame.data)
        elif op == Op.GAUGES_SECOND:
            return self._take_second(frame.data, datagram.stamp_ns)
        else:
            self._learn(op, frame.data)
        return []

    def health(self) -> tuple[str, ...]:
        """Lost frames and unanswered requests, in plain English."""
        halves = (f"{self.lost} readings lost one of their two frames",) if self.lost else ()
        return (*halves, *self._turn.health())

    def _take_first(self, data: bytes) -> None:
        if self._half is not None:
            self._lose()
        self._half = can_codec.decode_first(data)

    def _take_second(self, data: bytes, stamp_ns: int) -> list[WrenchSample]:
        odd = can_codec.decode_second(data)
        if self._half is None:
            self._lose()
            return []
        (status, even), self._half = self._half, None
        self._turn.on_answer()
        if self.calibration is None:
            raise CodecError("a reading before the board's calibration", where="CAN")
        gauges = np.array([[even[0], odd[0], even[1], odd[1], even[2], odd[2]]], dtype=np.float64)
        fault = "; ".join(can_codec.describe_status(status))
        return self._samples.make(gauges, self.calibration.working_matrix, [stamp_ns], [fault])

    def _lose(self) -> None:
        self.lost += 1
        self._samples.skip(1)

    def _learn(self, op: Op, data: bytes) -> None:
        """Take an answer about the calibration. A transfer begins with the serial number and ends with the units."""
        if op == Op.SERIAL:
            self._lesson = _Lesson(data.split(b"\0", 1)[0].decode("ascii", "replace").strip())
        elif self._lesson is None:
            return
        elif op in (Op.MATRIX, Op.MATRIX_SECOND, Op.MATRIX_THIRD):
            self._lesson.row_part(op, can_codec.decode_pair(data))
        elif op == Op.COUNTS_PER_UNIT:
            self._lesson.counts = can_codec.decode_counts(data)
        elif op == Op.UNITS:
            lesson, self._lesson = self._lesson, None
            self.calibration = lesson.finish(data) or self.calibration

    def _learn_all(self, talk: Conversation) -> bool:
        """Request the whole calibration once; returns whether the board answered at all."""
        answered = self._ask(talk, Op.SELECT_CALIBRATION, bytes([self._slot]), Op.SELECT_CALIBRATION)
        answered |= self._ask(talk, Op.SERIAL, b"", Op.SERIAL)
        if not answered:
            return False
        for axis in range(6):
            self._ask(talk, Op.MATRIX, bytes([axis]), Op.MATRIX_THIRD)
        self._ask(talk, Op.COUNTS_PER_UNIT, b"", Op.COUNTS_PER_UNIT)
        self._ask(talk, Op.UNITS, b"", Op.UNITS)
        return True

    def _ask(self, talk: Conversation, op: Op, data: bytes, last: Op) -> bool:
        """Send a request and wait for the last frame of the answer; returns whether it came."""
        before = self._answers.get(last, 0)
        talk.send(self._question(op, data))
        return talk.until(lambda: self._answers.get(last, 0) > before or None, _ANSWER_s) is not None

    def _question(self, op: Op, data: bytes = b"") -> bytes:
        return encode_frame(can_codec.request(op, data, self._base))

    def _check_serial(self, where: str, found: str) -> None:
        if self._serial and found != self._serial:
            raise DeviceError(
                f"the sensor is {found}, but the rig file names {self._serial}",
                where=where,
                hint="Swap the cables, or correct the rig file",
            )
