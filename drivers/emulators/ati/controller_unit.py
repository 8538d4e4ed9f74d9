"""An emulated stand-alone F/T controller, without its line: letters in, records out (protocols: F/T controller)."""

from __future__ import annotations

import numpy as np

from drivers.ati.protocols.controller_codec import Record, encode_ascii, encode_binary
from drivers.emulators.ati.sensor import EmulatedSensor

_PROMPT = b"\r\n>"
COUNTS_PER_N, COUNTS_PER_Nm = 320.0, 64_000.0


class ControllerUnit:
    """One controller.

    Args:
        sensor: the transducer behind it.
        rate_hz: records per second while it streams.

    Attributes:
        error: first number of its records.
        sent: records sent.
        unknown: number of unknown commands received.
    """

    def __init__(self, sensor: EmulatedSensor | None = None, rate_hz: float = 60.0) -> None:
        self.sensor = sensor or EmulatedSensor()
        self.rate_hz = rate_hz
        self.error = self.sent = self.unknown = 0
        self.streaming = self._binary = False
        self._line = b""

    def handle(self, payload: bytes) -> list[bytes]:
        """Process letters: each is echoed; a carriage return ends a command and any stream."""
        answers = []
        for letter in payload:
            if letter != 0x0D:
                self._line = (self._line + bytes([letter]))[-80:]
                continue
            command, self._line = self._line.decode("ascii", "replace").strip().upper(), b""
            was_streaming, self.streaming = self.streaming, False
            answers.append(command.encode("ascii", "replace") + b"\r\n" + self._answer(command, was_streaming))
        return answers

    def tick(self) -> bytes | None:
        """The next record of a stream."""
        return self._record() if self.streaming else None

    def _answer(self, command: str, was_streaming: bool) -> bytes:
        if command in ("", "CD R", "CV 3F") or (command == "" and was_streaming):
            return _PROMPT[2:] if not command else _PROMPT
        if command in ("CD A", "CD B"):
            self._binary = command == "CD B"
            return _PROMPT
        if command == "QR":
            return self._record() + (b"\x06" if self._binary else b"") + _PROMPT
        if command == "QS":
            self.streaming = True
            return b""
        self.unknown += 1
        return b"E" + _PROMPT

    def _record(self) -> bytes:
        self.sent += 1
        scale = np.repeat([COUNTS_PER_N, COUNTS_PER_Nm], 3)
        counts = np.clip(np.rint(self.sensor.wrench() * scale), -32768, 32767)
        record = Record(self.error, tuple(int(count) for count in counts))
        return encode_binary(record) if self._binary else encode_ascii(record)
