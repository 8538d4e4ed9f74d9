"""What every source of pictures gives: pictures as they arrived, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from drivers.camera.frames import Image


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture as it arrived.

    Attributes:
        stamp_ns: arrival, session clock.
        counter: its number.
        dropped: frames lost so far.
        image: grey levels, shape (height, width).
        file: name of the file it was read from; empty for a camera's.
    """

    stamp_ns: int
    counter: int
    dropped: int
    image: Image
    file: str = ""

    @property
    def name(self) -> str:
        """What people know it by: its file, or its number."""
        return self.file or f"picture {self.counter}"


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
