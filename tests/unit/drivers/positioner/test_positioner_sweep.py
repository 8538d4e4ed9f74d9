"""Every fault of a wire against the positioner."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from drivers.core.clock import VirtualClock
from drivers.core.transports import Datagram, MemoryTransport, Transport
from drivers.positioner.codec import PositionerStatus, decode_command, encode_status
from drivers.positioner.positioner import Positioner, PositionerSample
from drivers.positioner.ur.codec import (
    ArmFlags,
    ArmState,
    ArmStatus,
    decode_arm_command,
    encode_arm_status,
)
from drivers.positioner.ur.device import UrPositioner
from tests.support.driver_sweep import DriverSweep, SweptDevice
from tests.support.faults import Field, MessageLayout

_ARM = ArmState(0.0, 7, 2, 1, 1.0, (0.0, 0.0, 0.0), ArmFlags.HEARD | ArmFlags.PROGRAM)


class Carriage:
    """A positioner that stands where it was told to stand."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock, self._q = clock, np.zeros(6)
        self._waiting: list[Datagram] = []

    def write(self, payload: bytes) -> None:
        command = decode_command(payload)
        self._q = self._q if command.targets is None else command.targets
        status = encode_status(PositionerStatus(command.sequence, self._q))
        self._waiting.append(Datagram(status, self._clock.now_ns()))

    def read(self) -> list[Datagram]:
        arrived, self._waiting = self._waiting, []
        return arrived


class ArmCarriage(Carriage):
    """An arm's process that is there at once."""

    def write(self, payload: bytes) -> None:
        command = decode_arm_command(payload)
        self._q = self._q if command.targets is None else command.targets
        status = encode_arm_status(ArmStatus(command.sequence, self._q, _ARM))
        self._waiting.append(Datagram(status, self._clock.now_ns()))


class TestPositioner(DriverSweep):
    layout = MessageLayout(counters=(Field(0, 4, "little"),), values=(4, 52))
    blind: ClassVar[dict[str, str]] = {
        "clock jump": "the stamp of a status is not judged: each answers a command of the same cycle",
    }
    harmless: ClassVar[frozenset[str]] = frozenset({"counter wrap", "duplicate"})
    stops: ClassVar[frozenset[str]] = frozenset({"unplug", "delay", "stuck value", "flip a bit"})

    carriage: ClassVar[type[Carriage]] = Carriage
    device: ClassVar[type[Positioner]] = Positioner

    def runtime(self) -> SweptDevice:
        clock = VirtualClock()
        transport = MemoryTransport("base", self.carriage(clock))

        def build(transport: Transport) -> Positioner:
            return self.device(transport, clock)

        def use(device: Positioner) -> list[PositionerSample]:
            turn = clock.now_ns() / 1e9
            device.set_target(np.array([0.05 * np.sin(turn), 0.05 * turn, 0.2, 0.6 * turn, 0.0, 0.0]))
            sample = device.exchange()
            return [sample] if sample.fresh else []

        return SweptDevice(transport, clock, build, lambda: None, use)


class TestUrArm(TestPositioner):
    layout = MessageLayout(counters=(Field(0, 4, "little"),), values=(4, 52))
    carriage = ArmCarriage
    device = UrPositioner
