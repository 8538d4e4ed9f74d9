"""The positioner that carries the forearm, as seen from its transport: targets in, measured joints out."""

from __future__ import annotations

from drivers.core.transports import Datagram
from drivers.positioner.codec import BINARY, PositionerCodec, PositionerStatus
from drivers.simulation.hand_plant import CarriedPlant


class PositionerEmulator:
    """Far end of the positioner's transport. It holds its last target until another arrives.

    Args:
        plant: the plant that it moves.
        codec: the format of its messages.
    """

    def __init__(self, plant: CarriedPlant, codec: PositionerCodec = BINARY) -> None:
        self._plant, self._codec = plant, codec
        self._outbox: list[Datagram] = []

    def write(self, payload: bytes) -> None:
        """Process a command and answer with the measured joints and the same sequence number; a query moves nothing.

        Raises:
            CodecError: the bytes are not a command.
        """
        command = self._codec.decode_command(payload)
        if command.targets is not None:
            self._plant.move_base(command.targets)
        status = PositionerStatus(command.sequence, self._plant.base)
        self._outbox.append(Datagram(self._codec.encode_status(status), self._plant.stamp_ns))

    def read(self) -> list[Datagram]:
        """The answers since the last call."""
        arrived, self._outbox = self._outbox, []
        return arrived
