"""The positioner that carries the forearm, as seen from its link: targets in, measured joints out."""

from __future__ import annotations

import struct

import numpy as np

from drivers.links import Datagram
from drivers.simulation.plant import Plant
from tactile_lab.errors import CodecError

_IMAGE = struct.Struct("<I6d")


class PositionerEmulator:
    """Far end of the positioner's link. It holds its last target for as long as no other comes.

    Args:
        plant: what it moves.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._outbox: list[Datagram] = []

    def write(self, payload: bytes) -> None:
        """Take a command and answer with the measured joints under the same sequence number.

        Raises:
            CodecError: not a command.
        """
        if len(payload) != _IMAGE.size:
            raise CodecError(f"a command of {len(payload)} bytes instead of {_IMAGE.size}", where="positioner")
        sequence, *target = _IMAGE.unpack(payload)
        self._plant.move_base(np.array(target))
        self._outbox.append(Datagram(_IMAGE.pack(sequence, *self._plant.base), self._plant.stamp_ns))

    def read(self) -> list[Datagram]:
        """The answers since the last call."""
        arrived, self._outbox = self._outbox, []
        return arrived
