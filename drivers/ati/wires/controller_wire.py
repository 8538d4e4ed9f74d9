"""A Nano17 behind an F/T controller on RS-232: letters as commands, counts as answers (protocols: F/T controller)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from drivers.ati.protocols.controller_codec import PROMPT, AsciiLines, BinaryAnswers, Record
from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.wire import Turn
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, Transport
from drivers.force.force_fingertip import WrenchSample

BAUD_RATES = (9600, 19_200, 38_400)
_ANSWER_s, _QUIET_s = 0.5, 0.2


class ControllerWire:
    """The RS-232 line of one controller. In ASCII mode it streams; in binary mode each request gets a record.

    Resolved readings of a sensor at rest can stay equal for long, so equal readings do not prove that it is stuck.

    Args:
        mode: form of the records.
        counts_per_N, counts_per_Nm: the controller's scale, from its calibration papers.
    """

    stuck_after = 1 << 31
    step = 0
    ranges_SI: Array | None = None

    def __init__(self, mode: Literal["ascii", "binary"], counts_per_N: float, counts_per_Nm: float) -> None:
        self._mode = mode
        self._scale = np.repeat([counts_per_N, counts_per_Nm], 3)
        self._records: AsciiLines | BinaryAnswers = AsciiLines() if mode == "ascii" else BinaryAnswers()
        self._turn = Turn(patience_s=0.25)  # a record takes 25 ms at 9600 baud
        self._count = 0
        self._heard = b""

    def start(self, talk: Conversation) -> None:
        """Stop an old stream, set the form of records and the axes, and start.

        Raises:
            DeviceError: no controller answers, or its baud rate differs.
        """
        self._turn.restart()
        talk.send(b"\r")
        talk.wait(_QUIET_s)
        self._command(talk, "")
        for command in ("CD B" if self._mode == "binary" else "CD A", "CD R", "CV 3F"):
            self._command(talk, command)
        if self._mode == "ascii":
            talk.send(b"QS\r")

    def ask(self, transport: Transport, now_ns: int) -> None:
        """Request the next record, in binary mode. Raises DeviceError."""
        if self._mode == "binary" and self._turn.mine(now_ns):
            transport.send(b"QR\r")

    def stop(self, transport: Transport) -> None:
        """End a stream. Raises DeviceError."""
        transport.send(b"\r")

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one chunk of received bytes."""
        self._heard = (self._heard + datagram.payload)[-256:]
        before = self._records.damaged
        records = self._records.feed(datagram.payload)
        if records or self._records.damaged > before:
            self._turn.on_answer()
        return [self._sample(record, datagram.stamp_ns) for record in records]

    def health(self) -> tuple[str, ...]:
        """Damaged records and unanswered requests, in plain English."""
        damaged = self._records.damaged
        return (*((f"{damaged} damaged records",) if damaged else ()), *self._turn.health())

    def _sample(self, record: Record, stamp_ns: int) -> WrenchSample:
        self._count += 1
        faults = (f"the controller reports error {record.error}",) if record.error else ()
        wrench = np.full(6, np.nan) if faults else np.array(record.counts) / self._scale
        return WrenchSample(stamp_ns, wrench, self._count, self._count, faults=faults)

    def _command(self, talk: Conversation, command: str) -> None:
        """Send a command and wait for the prompt. Raises DeviceError when none comes."""
        self._heard = b""
        talk.send(command.encode("ascii") + b"\r")
        if talk.until(lambda: PROMPT in self._heard or None, _ANSWER_s) is not None:
            return
        if self._heard:
            raise DeviceError(
                "the answer is not from an F/T controller at this baud rate",
                where=talk.name,
                hint="Compare the baud rate with the controller's (9600, 19200 or 38400)",
            )
        hint = "Check power, cable, port and baud rate"
        raise DeviceError("the controller does not answer", where=talk.name, hint=hint)
