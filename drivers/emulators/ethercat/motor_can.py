"""The motors' CAN buses as seen through the palm's bridge: bootloaders that report their version.

The messages that the palm itself exchanges with its motors were never published, so only the bootloader is emulated: it
acknowledges frames and answers a version query (protocols: Motor CAN buses).
"""

from __future__ import annotations

from collections import deque

from drivers.core.errors import CodecError
from drivers.shadow.protocol.motor_can import BootCommand, Direction, MotorIdentifier
from drivers.shadow.protocol.palm_codec import CanFrame

VERSION = bytes((0x40, 0x41, 0x42, 0x43))
"""The version that every bootloader reports."""


class MotorCanBuses:
    """Two buses of ten motors each, all in their bootloaders.

    Args:
        missing: motors of the hand, 0 to 19, that are missing.
    """

    def __init__(self, missing: frozenset[int] = frozenset()) -> None:
        self._missing = missing
        self._waiting: deque[CanFrame] = deque()
        self.heard: list[CanFrame] = []

    def transfer(self, frame: CanFrame) -> CanFrame:
        """Send a frame; returns a frame that waits for the palm, or an empty one."""
        if frame.bus:
            self.heard.append(frame)
            self._answer(frame)
        return self._waiting.popleft() if self._waiting else CanFrame()

    def announce(self, frame: CanFrame) -> None:
        """Let a motor send a frame without a request."""
        self._waiting.append(frame)

    def _answer(self, frame: CanFrame) -> None:
        try:
            asked = MotorIdentifier.of(frame.identifier)
            motor = asked.motor(frame.bus)
        except CodecError:
            return  # not addressed to anyone on the bus
        known = asked.kind in set(BootCommand)
        if asked.direction is not Direction.BOOTLOADER or not known or asked.acknowledged or motor in self._missing:
            return
        answer = MotorIdentifier(Direction.BOOTLOADER, asked.number, asked.kind, acknowledged=True)
        data, length = frame.data, frame.length
        if asked.kind == BootCommand.VERSION:
            data, length = VERSION.ljust(8, b"\0"), len(VERSION)
        self._waiting.append(CanFrame(frame.bus, length, answer.identifier, data))
