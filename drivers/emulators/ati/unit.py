"""What an emulated device is: bytes in, bytes out, and a stream; on which wire, it does not know."""

from __future__ import annotations

from typing import Protocol


class Unit(Protocol):
    """One emulated device."""

    def handle(self, payload: bytes) -> list[bytes]:
        """Take what the program sent; the answers."""

    def tick(self) -> bytes | None:
        """The next message of the stream; None while there is none."""

    @property
    def rate_hz(self) -> float:
        """Messages of the stream per second."""
