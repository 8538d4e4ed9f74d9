"""Net F/T boxes with Nano17 sensors as seen from the wire, one RDT stream per fingertip (protocols: Net F/T).

Here the boxes of the five fingers sample at the same instants; real boxes each follow their own clock.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from drivers.ati.protocols import rdt_codec
from drivers.ati.protocols.rdt_codec import RECORD, Command
from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS, Array
from drivers.core.transports import Datagram
from drivers.simulation.devices.nano_sensors import SHAPE, NanoSensors, six
from drivers.simulation.hand_plant import TipPlant
from drivers.simulation.settings import ForceSensorSettings

INTERNAL_RATE_Hz = 7000
_SATURATED = rdt_codec.SATURATION | 1 << 31
_SOCKET_DATAGRAMS = 5000  # what a receive buffer holds before datagrams are lost


class RdtBox:
    """Far end of one fingertip's transport: processes requests, and sends a record for each reading during a stream."""

    def __init__(self) -> None:
        self.sent = 0
        self.bias_asked = False
        self._left: int | None = 0  # records still to send; None for an endless stream
        self._outbox: deque[Datagram] = deque(maxlen=_SOCKET_DATAGRAMS)

    @property
    def streaming(self) -> bool:
        """Whether a client has started a stream."""
        return self._left != 0

    def write(self, payload: bytes) -> None:
        """Process a request. A start numbers the records from 1 again; after a software bias a new start is needed.

        Raises:
            CodecError: the bytes are not an RDT request.
        """
        request = rdt_codec.decode_request(payload)
        if request.command == Command.START:
            self._left, self.sent = request.count or None, 0
        elif request.command in (Command.STOP, Command.SET_SOFTWARE_BIAS):
            self._left = 0
            self.bias_asked = self.bias_asked or request.command == Command.SET_SOFTWARE_BIAS

    def read(self) -> list[Datagram]:
        """The records that have arrived since the last call, one per datagram."""
        arrived = list(self._outbox)
        self._outbox.clear()
        return arrived

    def push(self, record: bytes, stamp_ns: int) -> None:
        """Send one record."""
        self._left = None if self._left is None else self._left - 1
        self._outbox.append(Datagram(record, stamp_ns))


class RdtBank:
    """The boxes of all five fingers with their common sampling time.

    Args:
        plant: the physics behind the sensors.
        settings: rate, scale and errors.
        rng: random numbers for the errors.

    Attributes:
        boxes: far end of each finger's transport.
    """

    def __init__(self, plant: TipPlant, settings: ForceSensorSettings, rng: np.random.Generator) -> None:
        self.boxes = {finger: RdtBox() for finger in FINGERS}
        self._plant, self._sensors = plant, NanoSensors(plant, settings, rng)
        self._period_ns = NANOSECONDS // settings.rate_hz
        self._next_ns = plant.stamp_ns + self._period_ns
        self._software_bias = np.zeros(SHAPE)
        self._scale = six(settings.counts_per_N, settings.counts_per_Nm)

    @property
    def next_event_ns(self) -> int | None:
        """When the next reading is due."""
        return self._next_ns

    def tick(self) -> None:
        """Read the sensors, and send a record from every box that has a client."""
        self._next_ns += self._period_ns
        wrenches, saturated = self._sensors.read()
        for row, box in enumerate(self.boxes.values()):
            if box.bias_asked:
                self._software_bias[row], box.bias_asked = wrenches[row], False
            box.sent += box.streaming
        if any(box.streaming for box in self.boxes.values()):
            self._send(self._records(wrenches - self._software_bias, saturated))

    def _records(self, wrenches: Array, saturated: NDArray[np.bool_]) -> bytes:
        """The records of all five boxes, one after the other."""
        internal_samples = self._plant.stamp_ns * INTERNAL_RATE_Hz // NANOSECONDS
        return rdt_codec.encode_records(
            np.array([box.sent for box in self.boxes.values()]),
            np.full(len(FINGERS), internal_samples),
            np.where(saturated, _SATURATED, 0),
            np.rint(wrenches * self._scale),
        )

    def _send(self, records: bytes) -> None:
        for row, box in enumerate(self.boxes.values()):
            if box.streaming:
                box.push(records[row * RECORD.itemsize : (row + 1) * RECORD.itemsize], self._plant.stamp_ns)
