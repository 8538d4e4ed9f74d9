"""An emulated Net F/T box, without its sockets: RDT requests and records, and web pages (protocols: Net F/T)."""

from __future__ import annotations

import struct
from urllib.parse import parse_qsl, urlsplit
from xml.sax.saxutils import escape

import numpy as np

from drivers.ati.protocols import rdt_codec
from drivers.ati.protocols.rdt_codec import Command
from drivers.ati.wires import net_box
from drivers.core.errors import CodecError
from drivers.emulators.ati.sensor import EmulatedSensor

COUNTS_PER_UNIT = 1_000_000
COUNTS_BYTES = 24
_HEAD = struct.Struct(">III")


class NetBoxUnit:
    """One box.

    Args:
        sensor: the transducer behind it.
        rate_hz: records per second of its real-time stream at power-up.

    Attributes:
        sent: records sent since the last start.
        refused: number of invalid requests.
        status: status word of the records.
        rate_locked: whether the box ignores a new rate, as some do.
    """

    def __init__(self, sensor: EmulatedSensor | None = None, rate_hz: int = 7000) -> None:
        self.sensor = sensor or EmulatedSensor()
        self.sent = self.refused = self.status = 0
        self.rate_locked = False
        self._rate_hz, self._left = rate_hz, 0
        self._measured = 0
        self._bias = np.zeros(6)

    @property
    def rate_hz(self) -> float:
        """Records per second."""
        return self._rate_hz

    @property
    def streaming(self) -> bool:
        """Whether a client has started a stream."""
        return self._left != 0

    def handle(self, payload: bytes) -> list[bytes]:
        """Process a request; a box sends no reply, and ignores invalid requests."""
        try:
            request = rdt_codec.decode_request(payload)
        except CodecError:
            self.refused += 1
            return []
        if request.command in (Command.START, Command.START_BUFFERED):
            self._left, self.sent = request.count or -1, 0
        elif request.command in (Command.STOP, Command.SET_SOFTWARE_BIAS):
            self._left = 0
            if request.command == Command.SET_SOFTWARE_BIAS:
                self._bias = self.sensor.wrench()
        return []

    def tick(self) -> bytes | None:
        """The next record; the sample counter advances whether or not a client listens."""
        self._measured += self._step
        if not self.streaming:
            return None
        self._left -= self._left > 0
        self.sent += 1
        counts = np.rint((self.sensor.wrench() - self._bias) * COUNTS_PER_UNIT).astype(int).tolist()
        return rdt_codec.encode_record(self.sent, self._measured, self.status, counts)

    def ticks(self, count: int) -> list[bytes]:
        """The next ``count`` records, as from :meth:`tick`, but with one reading of the load for all of them."""
        first = self.tick() if count else None
        if first is None:
            self._measured += (count - 1) * self._step if count else 0
            return []
        counts = first[-COUNTS_BYTES:]
        heads = (self._next_head() for _ in range(count - 1))
        return [first, *(head + counts for head in heads if head)]

    def _next_head(self) -> bytes:
        """The header of the next record; empty if no client wants more."""
        self._measured += self._step
        if not self.streaming:
            return b""
        self._left -= self._left > 0
        self.sent += 1
        return _HEAD.pack(self.sent & 0xFFFFFFFF, self._measured & 0xFFFFFFFF, self.status & 0xFFFFFFFF)

    @property
    def _step(self) -> int:
        return round(net_box.INTERNAL_RATE_Hz / self._rate_hz)

    def page(self, target: str) -> bytes | None:
        """The web server's answer to a path with its query; None for a page that does not exist."""
        parts = urlsplit(target)
        if parts.path == "/comm.cgi":
            wanted = dict(parse_qsl(parts.query)).get("comrdtrate", "")
            if wanted.isdigit() and 1 <= int(wanted) <= net_box.INTERNAL_RATE_Hz and not self.rate_locked:
                self._rate_hz = net_box.achievable_rate(int(wanted))
            return b"<html><body>stored</body></html>"
        return self._state().encode("ascii") if parts.path == net_box.PAGE else None

    def _state(self) -> str:
        values = {
            "prodname": "Emulated Net F/T",
            "cfgnam": "Emulated",
            "cfgcalsel": 0,
            "cfgcalsn": self.sensor.calibration.serial,
            "cfgfu": 2,
            "scfgfu": "N",
            "cfgtu": 3,
            "scfgtu": "Nm",
            "cfgcpf": COUNTS_PER_UNIT,
            "cfgcpt": COUNTS_PER_UNIT,
            "cfgtfx": "0;0;0;0;0;0",
            "cfgmr": ";".join(f"{value:g}" for value in self.sensor.calibration.ratings),
            "comrdte": 1,
            "comrdtrate": self._rate_hz,
            "comrdtbsiz": 1,
            "runrate": net_box.INTERNAL_RATE_Hz,
            "runstat": f"0x{self.status:08x}",
            "mfgdigver": "emulated",
        }
        tags = "".join(f"<{tag}>{escape(str(value))}</{tag}>" for tag, value in values.items())
        return f'<?xml version="1.0"?><netft>{tags}</netft>'
