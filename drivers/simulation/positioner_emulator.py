"""The positioner that carries the forearm, as seen from its link: targets in, measured joints out."""

from __future__ import annotations

from drivers.links import Datagram
from drivers.positioner_codec import PositionerStatus, decode_command, encode_status
from drivers.simulation.hand_plant import CarriedPlant


class PositionerEmulator:
    """Far end of the positioner's link. It holds its last target for as long as no other comes.

    Args:
        plant: what it moves.
    """

    def __init__(self, plant: CarriedPlant) -> None:
        self._plant = plant
        self._outbox: list[Datagram] = []

    def write(self, payload: bytes) -> None:
        """Take a command and answer with the measured joints under the same sequence number; a question moves nothing.

        Raises:
            CodecError: not a command.
        """
        command = decode_command(payload)
        if command.targets is not None:
            self._plant.move_base(command.targets)
        status = PositionerStatus(command.sequence, self._plant.base)
        self._outbox.append(Datagram(encode_status(status), self._plant.stamp_ns))

    def read(self) -> list[Datagram]:
        """The answers since the last call."""
        arrived, self._outbox = self._outbox, []
        return arrived
