"""The interface of all sources of pictures: they return pictures one after the other, as they arrive."""

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
        file: name of the file it was read from; empty for a camera.
    """

    stamp_ns: int
    counter: int
    dropped: int
    image: Image
    file: str = ""

    @property
    def name(self) -> str:
        """Its name for people: its file, or its number."""
        return self.file or f"picture {self.counter}"


class Source(Protocol):
    """A source of pictures."""

    def open(self) -> None:
        """Open the source. Raises DeviceError, ConfigurationError."""

    def read(self) -> Picture | None:
        """Wait for the next picture; None at the end. Raises DeviceError."""

    def close(self) -> None:
        """Close the source; idempotent."""

    def notes(self) -> tuple[str, ...]:
        """Settings that the source did not accept, in plain English."""
