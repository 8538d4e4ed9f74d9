"""The interface between the device class and the wires that carry a Nano17's readings.

A wire sets up its device, decodes what the device sends, and reports what is wrong with the connection. Decoding
depends only on the settings and on the messages received so far, including the answers during set-up. So a replay,
which has only the messages, decodes the same samples as the session.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.patience import Patience
from drivers.core.contacts import Array
from drivers.core.transports import Datagram, Transport
from drivers.force.force_fingertip import WrenchSample

GAUGES = 6


class ForceWire(Protocol):
    """One transport of one sensor.

    Attributes:
        stuck_after: equal readings in a row after which the sensor counts as stuck.
        step: how far the sensor's counter advances from sample to sample; 0 if unknown.
    """

    stuck_after: int
    step: int

    @property
    def ranges_SI(self) -> Array | None:
        """Calibrated range of each axis, N and N m, shape (6,); None if the device has not reported it."""

    def start(self, talk: Conversation) -> None:
        """Set up the device, whatever state it is in, and start its stream.

        Raises:
            DeviceError: it does not answer, or is not the expected device; the message says why.
        """

    def ask(self, transport: Transport, now_ns: int) -> None:
        """Request the next reading, if the device sends only on request. Raises DeviceError."""

    def stop(self, transport: Transport) -> None:
        """End the stream. Raises DeviceError."""

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one message. Raises CodecError for bytes of another protocol."""

    def health(self) -> tuple[str, ...]:
        """What is wrong with the wire, in plain English."""


@runtime_checkable
class FastWire(Protocol):
    """A wire that decodes many messages faster in one call than one by one."""

    def receive_many(self, datagrams: list[Datagram]) -> tuple[list[WrenchSample], int]:
        """The samples of all messages, oldest first, and how many messages did not belong to this protocol."""


class GaugeSamples:
    """Turns gauge readings into samples: checks them, applies the matrix, and numbers them if the wire does not.

    A reading with a gauge at its limit is invalid as a whole, and so is one that the device reports as faulty: its
    wrench is NaN and its faults say why.

    Args:
        limit: reading at and beyond which a gauge is saturated.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._count = self._changes = 0
        self._before: bytes | None = None

    def skip(self, lost: int) -> None:
        """Count samples that were sent but lost."""
        self._count += lost

    def make(
        self,
        readings: Array,
        matrix: Array,
        stamps_ns: list[int],
        faults: list[str],
        corrected: Array | None = None,
    ) -> list[WrenchSample]:
        """Turn readings into samples, oldest first.

        Args:
            readings: gauges 0 to 5, shape (n, 6).
            matrix: from readings to N and N m, shape (6, 6).
            stamps_ns: arrival of each.
            faults: the fault that the device reports for each, "" for none.
            corrected: the values to multiply by the matrix if they differ from the readings, shape (n, 6).
        """
        saturated = np.abs(readings) >= self._limit
        wrenches = (readings if corrected is None else corrected) @ matrix.T
        return [
            self._one(stamp_ns, wrench, reading.tobytes(), _objections(over, fault))
            for stamp_ns, wrench, reading, over, fault in zip(
                stamps_ns, wrenches, readings, saturated, faults, strict=True
            )
        ]

    def _one(self, stamp_ns: int, wrench: Array, reading: bytes, objections: tuple[str, ...]) -> WrenchSample:
        self._count += 1
        self._changes += reading != self._before
        self._before = reading
        usable = wrench if not objections else np.full(GAUGES, np.nan)
        return WrenchSample(stamp_ns, usable, self._count, self._changes, faults=objections)


def _objections(saturated: Array, fault: str) -> tuple[str, ...]:
    words = [f"gauge {gauge} saturated" for gauge in np.flatnonzero(saturated)] if saturated.any() else []
    return (*words, fault) if fault else tuple(words)


def spread_stamps(previous_ns: int | None, arrived_ns: int, count: int, longest_ns: int) -> list[int]:
    """Spread the stamps of samples that arrived in one chunk of a steady stream back to the chunk before.

    Args:
        previous_ns: arrival of the chunk before; None for the first.
        arrived_ns: arrival of this chunk, which is the stamp of its last sample.
        count: samples in it.
        longest_ns: the longest time to spread the stamps over.
    """
    if count == 0:
        return []
    span = 0 if previous_ns is None else min(max(arrived_ns - previous_ns, 0), longest_ns)
    return [arrived_ns - span * (count - 1 - index) // count for index in range(count)]


class Turn:
    """Decides when to send the next request: after the answer to the last one, or when that answer is overdue.

    Args:
        patience_s: how long to wait for an answer.

    Attributes:
        unanswered: requests that got no answer in time.
    """

    def __init__(self, patience_s: float) -> None:
        self.unanswered = 0
        self._patience_s = patience_s
        self._waiting: Patience | None = None

    def restart(self) -> None:
        """Forget the open request, as after connecting."""
        self._waiting = None

    def on_answer(self) -> None:
        """Note that an answer has arrived."""
        self._waiting = None

    def mine(self, now_ns: int) -> bool:
        """Whether to send a request now; if so, it counts as sent."""
        if self._waiting is not None and not self._waiting.over(now_ns):
            return False
        self.unanswered += self._waiting is not None
        self._waiting = Patience(self._patience_s, now_ns)
        return True

    def health(self) -> tuple[str, ...]:
        """Unanswered requests, in plain English."""
        return (f"{self.unanswered} requests without an answer",) if self.unanswered else ()
