"""The interface of an emulated device: bytes in, bytes out, and a stream. It does not know its wire."""

from __future__ import annotations

from typing import Protocol


class Unit(Protocol):
    """One emulated device."""

    def handle(self, payload: bytes) -> list[bytes]:
        """Process what the program sent; returns the answers."""

    def tick(self) -> bytes | None:
        """The next message of the stream; None if there is none."""

    @property
    def rate_hz(self) -> float:
        """Messages of the stream per second."""
