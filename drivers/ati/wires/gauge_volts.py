"""A Nano17 on a plain amplifier: gauge volts, and ATI's .cal file (protocols: Gauge volts; ATI calibration files).

The program that reads the acquisition card sends one message per reading: a 32-bit counter, the volts of gauges 0 to 5
as 64-bit floats and, if there is a thermistor, its volts; all little-endian.
"""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np

from drivers.ati.protocols.cal_file import AtiCalibration
from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.wire import GAUGES, GaugeSamples
from drivers.core.contacts import Array
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, Transport
from drivers.force.force_fingertip import WrenchSample

PLAIN, WITH_THERMISTOR = struct.Struct("<I6d"), struct.Struct("<I7d")
_SATURATED_SHARE = 0.99
_FIRST_READING_s = 1.0


def encode_volts(counter: int, volts: tuple[float, ...]) -> bytes:
    """A reading of six gauges, with or without thermistor. Raises CodecError for another number of values."""
    form = {GAUGES: PLAIN, GAUGES + 1: WITH_THERMISTOR}.get(len(volts))
    if form is None:
        raise CodecError(f"{len(volts)} volts instead of six or seven", where="gauge volts")
    return form.pack(counter & 0xFFFFFFFF, *volts)


def decode_volts(payload: bytes) -> tuple[int, Array]:
    """Counter and volts, shape (6,) or (7,). Raises CodecError for a wrong length or values that are not finite."""
    form = {PLAIN.size: PLAIN, WITH_THERMISTOR.size: WITH_THERMISTOR}.get(len(payload))
    if form is None:
        raise CodecError(f"{len(payload)} bytes instead of {PLAIN.size} or {WITH_THERMISTOR.size}", where="volts")
    counter, *volts = form.unpack(payload)
    if not np.isfinite(volts).all():
        raise CodecError("volts that are not finite", where="gauge volts", hint="Check the acquisition program")
    return counter, np.array(volts)


class GaugeVoltsWire:
    """Converts volts by a calibration file.

    Args:
        calibration: of the sensor on the amplifier.

    Attributes:
        counter: of the newest message.
    """

    stuck_after = 100
    step = 0

    def __init__(self, calibration: AtiCalibration) -> None:
        if calibration.output_range_V is None:
            raise CodecError(
                f"the calibration of {calibration.serial} is in counts, not volts",
                where="gauge volts",
                hint="Give the sensor's .cal file",
            )
        self.counter: int | None = None
        self.ranges_SI: Array | None = calibration.ranges_SI
        self._calibration = calibration
        self._changes, self._measured = 0, 0  # counter of the last message whose readings differed from those before
        self._samples = GaugeSamples(limit=_SATURATED_SHARE * calibration.output_range_V / 2.0)

    def start(self, talk: Conversation) -> None:
        """Check that readings arrive. Raises DeviceError if none does."""
        self.counter = None
        if talk.until(lambda: self.counter, _FIRST_READING_s) is None:
            raise DeviceError(
                "no gauge volts arrive", where=talk.name, hint="Start the acquisition program; compare address and port"
            )

    def ask(self, transport: Transport, now_ns: int) -> None:
        """Do nothing: the acquisition program sends by itself."""

    def stop(self, transport: Transport) -> None:
        """Do nothing: the acquisition program keeps running."""

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one reading. Raises CodecError if the bytes are not a reading."""
        counter, volts = decode_volts(datagram.payload)
        gauges, terms = volts[None, :GAUGES], self._calibration.temperature
        corrected = terms.correct(gauges, volts[GAUGES:]) if terms is not None and len(volts) > GAUGES else gauges
        (sample,) = self._samples.make(
            gauges, self._calibration.working_matrix, [datagram.stamp_ns], [""], corrected=corrected
        )
        self.counter = counter
        measured = self._measured if sample.measured == self._changes else counter
        self._changes, self._measured = sample.measured, measured
        return [replace(sample, sent=counter, measured=measured)]

    def health(self) -> tuple[str, ...]:
        """No problems of the wire itself: lost messages show in the counter of the samples."""
        return ()
