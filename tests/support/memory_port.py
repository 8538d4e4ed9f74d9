"""An EtherCAT port without a cable: the slaves are in the same process."""

from __future__ import annotations

from collections import deque
from typing import Protocol

from drivers.core.errors import DeviceError


class Ring(Protocol):
    """Slaves that a frame runs through."""

    def process(self, frame: bytes) -> list[bytes]:
        """The frames that come back when one is sent: usually just that frame, none if it was lost."""


class MemoryPort:
    """A port whose cable leads to slaves in the same process."""

    def __init__(self, ring: Ring, name: str = "memory") -> None:
        self.name, self._ring = name, ring
        self._arrived: deque[bytes] = deque()
        self._open = False

    @property
    def hardware_address(self) -> bytes:
        return bytes(6)

    def open(self) -> None:
        self._open = True

    def close(self) -> None:
        self._open = False
        self._arrived.clear()

    def send(self, frame: bytes) -> None:
        self._check_open()
        self._arrived.extend(self._ring.process(frame))

    def receive(self, timeout_s: float) -> bytes | None:
        self._check_open()
        return self._arrived.popleft() if self._arrived else None

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError("the interface is not open", where=self.name, hint="Connect the device first")
