"""Questions to the motors' bootloaders over any python-can bus (protocols: Motor CAN buses).

Nothing is erased or written.
"""

from __future__ import annotations

import can

from drivers.core.errors import DeviceError
from drivers.shadow.protocol.motor_can import BootCommand, Direction, MotorIdentifier, bus_of

ANSWER_s = 0.1
TRIES = 20


def bootloader_version(bus: can.BusABC, motor: int, tries: int = TRIES) -> bytes:
    """What a motor's bootloader says its version is, up to eight bytes.

    A motor answers only while it is in its bootloader: after a reset, until its firmware starts.

    Args:
        bus: reaches both motor buses; messages' channels are 1 and 2.
        motor: number in the hand, 0 to 19.
        tries: so often the question is put, 100 ms apart.

    Raises:
        DeviceError: no answer.
    """
    wire, number = bus_of(motor)
    question = MotorIdentifier(Direction.BOOTLOADER, number, BootCommand.VERSION)
    wanted = MotorIdentifier(Direction.BOOTLOADER, number, BootCommand.VERSION, acknowledged=True).identifier
    for _ in range(tries):
        bus.send(can.Message(arbitration_id=question.identifier, is_extended_id=False, channel=wire))
        while (answer := bus.recv(ANSWER_s)) is not None:
            if answer.arbitration_id == wanted and answer.channel == wire:
                return bytes(answer.data)
    hint = "Only a motor in its bootloader answers; check that it has power"
    raise DeviceError(f"motor {motor} does not report its bootloader's version", where=f"motor bus {wire}", hint=hint)
