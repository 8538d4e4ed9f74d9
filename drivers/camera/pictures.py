"""What every source of pictures gives: pictures as they arrived, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from drivers.camera.frames import Image


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture as it arrived: stamp (session clock), number, frames lost so far, grey levels (height, width)."""

    stamp_ns: int
    counter: int
    dropped: int
    image: Image


class Source(Protocol):
    """Something that gives pictures."""

    def open(self) -> None:
        """Begin. Raises DeviceError, ConfigurationError."""

    def read(self) -> Picture | None:
        """Wait for the next picture; None at the end. Raises DeviceError."""

    def close(self) -> None:
        """End; idempotent."""

    def notes(self) -> tuple[str, ...]:
        """What could not be had as it was asked for, in words."""
