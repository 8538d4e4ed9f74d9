"""What a simulated device is to the world it is part of."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class TimedDevice(Protocol):
    """A device that acts by itself at certain times."""

    @property
    def next_event_ns(self) -> int | None:
        """When it acts next; None while nothing is due."""

    def tick(self) -> None:
        """Act."""


class TactileSection(Protocol):
    """The five fingertip slots of the palm's status."""

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        """Valid bits (bit 0 FF to bit 4 TH) and the slots, shape (5, 16), for a requested type."""


class NoTactile:
    """Fingertips that have no connection to the palm: nothing is ever valid."""

    def answer(self, data_type: int) -> tuple[int, NDArray[np.uint8]]:
        return 0, np.zeros((5, 16), np.uint8)
