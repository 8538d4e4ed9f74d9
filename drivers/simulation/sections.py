"""The interfaces of simulated devices to their world."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class TimedDevice(Protocol):
    """A device that acts on its own at certain times."""

    @property
    def next_event_ns(self) -> int | None:
        """When it acts next; None if nothing is due."""

    def tick(self) -> None:
        """Act."""


class TactileSection(Protocol):
    """The five fingertip slots of the palm's status."""

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        """Valid bits (bit 0 FF to bit 4 TH) and the slots, shape (5, 16), for a requested type."""


class NoTactile:
    """Fingertips without a connection to the palm: all answers are invalid."""

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        return 0, np.zeros((5, 16), np.uint8)
