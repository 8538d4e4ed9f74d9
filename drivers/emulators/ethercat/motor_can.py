"""The motors' CAN buses as the palm's bridge reaches them: bootloaders that answer for their version.

What the palm itself exchanges with its motors on these buses was never published, so nothing but the bootloader is
here: a frame to it is acknowledged, a version query answered (protocols: Motor CAN buses).
"""

from __future__ import annotations

from collections import deque

from drivers.core.errors import CodecError
from drivers.shadow.protocol.motor_can import BootCommand, Direction, MotorIdentifier
from drivers.shadow.protocol.palm_codec import CanFrame

VERSION = bytes((0x40, 0x41, 0x42, 0x43))
"""What every bootloader answers for its version."""


class MotorCanBuses:
    """Two buses of ten motors each, all in their bootloaders.

    Args:
        missing: motors of the hand, 0 to 19, that are not there.
    """

    def __init__(self, missing: frozenset[int] = frozenset()) -> None:
        self._missing = missing
        self._waiting: deque[CanFrame] = deque()
        self.heard: list[CanFrame] = []

    def transfer(self, frame: CanFrame) -> CanFrame:
        """Send a frame; one that waits for the palm, an empty one for none."""
        if frame.bus:
            self.heard.append(frame)
            self._answer(frame)
        return self._waiting.popleft() if self._waiting else CanFrame()

    def announce(self, frame: CanFrame) -> None:
        """A motor speaks unasked."""
        self._waiting.append(frame)

    def _answer(self, frame: CanFrame) -> None:
        try:
            asked = MotorIdentifier.of(frame.identifier)
            motor = asked.motor(frame.bus)
        except CodecError:
            return  # nobody on the bus feels addressed
        known = asked.kind in set(BootCommand)
        if asked.direction is not Direction.BOOTLOADER or not known or asked.acknowledged or motor in self._missing:
            return
        answer = MotorIdentifier(Direction.BOOTLOADER, asked.number, asked.kind, acknowledged=True)
        data, length = frame.data, frame.length
        if asked.kind == BootCommand.VERSION:
            data, length = VERSION.ljust(8, b"\0"), len(VERSION)
        self._waiting.append(CanFrame(frame.bus, length, answer.identifier, data))
