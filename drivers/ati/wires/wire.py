"""The ways a Nano17's readings reach the computer: what each of them gives the one device class.

A wire sets its device up, decodes what it sends and knows what can be wrong with it. Its decoding depends on nothing
but its settings and the messages received so far, answers to set-up questions included: so a replay, which has the
messages alone, decodes what the session did.
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
        step: how far the measuring counter moves from sample to sample; 0 when that is not known.
    """

    stuck_after: int
    step: int

    @property
    def ranges_SI(self) -> Array | None:
        """Calibrated range of each axis, N and N m, shape (6,); None when the device has not told."""

    def start(self, talk: Conversation) -> None:
        """Set the device up from whatever state it is in, and start its stream.

        Raises:
            DeviceError: it does not answer, or is not the device it should be; says why.
        """

    def ask(self, transport: Transport, now_ns: int) -> None:
        """Ask for the next reading where the device sends only when asked. Raises DeviceError."""

    def stop(self, transport: Transport) -> None:
        """End the stream. Raises DeviceError."""

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one message. Raises CodecError for bytes of another protocol."""

    def health(self) -> tuple[str, ...]:
        """What is wrong with the wire, in words."""


@runtime_checkable
class FastWire(Protocol):
    """A wire that decodes many messages faster together than one by one."""

    def receive_many(self, datagrams: list[Datagram]) -> tuple[list[WrenchSample], int]:
        """The samples of all messages, oldest first, and how many messages were none of this protocol."""


class GaugeSamples:
    """Makes samples of gauge readings: the checks that come before the matrix, and counters for a wire without any.

    A reading with a gauge at its limit is void as a whole, and so is one that the device itself calls faulty: its
    wrench is NaN and its faults say why.

    Args:
        limit: reading at and beyond which a gauge is saturated.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._count = self._changes = 0
        self._before: bytes | None = None

    def skip(self, lost: int) -> None:
        """Note samples that were sent and are lost."""
        self._count += lost

    def make(
        self,
        readings: Array,
        matrix: Array,
        stamps_ns: list[int],
        faults: list[str],
        corrected: Array | None = None,
    ) -> list[WrenchSample]:
        """Samples of readings, oldest first.

        Args:
            readings: gauges 0 to 5, shape (n, 6).
            matrix: from readings to N and N m, shape (6, 6).
            stamps_ns: arrival of each.
            faults: what the device says is wrong with each, "" for nothing.
            corrected: what to multiply with the matrix, where that is not the readings themselves, shape (n, 6).
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
    """Stamps of samples that arrived together in one piece of a steady stream, spread back to the piece before.

    Args:
        previous_ns: arrival of the piece before; None for the first.
        arrived_ns: arrival of this piece, the stamp of its last sample.
        count: samples in it.
        longest_ns: never spread over more than this.
    """
    if count == 0:
        return []
    span = 0 if previous_ns is None else min(max(arrived_ns - previous_ns, 0), longest_ns)
    return [arrived_ns - span * (count - 1 - index) // count for index in range(count)]


class Turn:
    """Whose turn it is on a wire of question and answer: ask again when the answer has come, or will not any more.

    Args:
        patience_s: how long to wait for an answer.

    Attributes:
        unanswered: questions given up.
    """

    def __init__(self, patience_s: float) -> None:
        self.unanswered = 0
        self._patience_s = patience_s
        self._waiting: Patience | None = None

    def restart(self) -> None:
        """Nothing is asked, as after connecting."""
        self._waiting = None

    def on_answer(self) -> None:
        """An answer has come."""
        self._waiting = None

    def mine(self, now_ns: int) -> bool:
        """Whether to ask now; then the question counts as asked."""
        if self._waiting is not None and not self._waiting.over(now_ns):
            return False
        self.unanswered += self._waiting is not None
        self._waiting = Patience(self._patience_s, now_ns)
        return True

    def health(self) -> tuple[str, ...]:
        """Questions without an answer, in words."""
        return (f"{self.unanswered} requests without an answer",) if self.unanswered else ()
