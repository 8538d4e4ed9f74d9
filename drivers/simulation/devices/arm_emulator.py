"""An arm of Universal Robots as the session sees it from its transport: commands in, statuses with its state out.

It stands where the arm's own process and the arm would, in virtual time; the control box itself is emulated in
:mod:`drivers.emulators.ur`.
"""

from __future__ import annotations

from dataclasses import replace

from drivers.core.clock import NANOSECONDS
from drivers.core.transports import Datagram
from drivers.positioner.ur.codec import (
    ArmFlags,
    ArmOrder,
    ArmState,
    ArmStatus,
    decode_arm_command,
    encode_arm_status,
)
from drivers.simulation.hand_plant import CarriedPlant

_READY = ArmState(0.0, 7, 2, 1, 1.0, (0.0, 0.0, 0.0), ArmFlags.HEARD | ArmFlags.PROGRAM)


class ArmEmulator:
    """Far end of the arm's transport.

    Args:
        plant: what it moves.

    Attributes:
        state: what it says of itself; a test may replace it.
    """

    def __init__(self, plant: CarriedPlant) -> None:
        self._plant = plant
        self.state = _READY
        self._outbox: list[Datagram] = []

    def write(self, payload: bytes) -> None:
        """Take a command and answer with where the arm stands. An arm that is led stays. Raises CodecError."""
        command = decode_arm_command(payload)
        free = command.order is ArmOrder.FREEDRIVE
        if command.targets is not None and not free:
            self._plant.move_base(command.targets)
        flags = self.state.flags & ~ArmFlags.FREE | free * ArmFlags.FREE
        state = replace(self.state, time_s=self._plant.stamp_ns / NANOSECONDS, flags=flags)
        status = encode_arm_status(ArmStatus(command.sequence, self._plant.base, state))
        self._outbox.append(Datagram(status, self._plant.stamp_ns))

    def read(self) -> list[Datagram]:
        """The answers since the last call."""
        arrived, self._outbox = self._outbox, []
        return arrived
