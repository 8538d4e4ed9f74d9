"""What the palm asks its fingertips for, cycle by cycle.

A BioTac answers each request with two values, the requested one and the next. Asking for the pressure (then also the
heater voltage follows), the temperature (with the first electrode) and every even electrode covers all 24 electrodes
in 14 cycles, as Shadow's own polling table does. The vibration channel comes twice with every answer.
"""

from __future__ import annotations

from enum import IntEnum
from itertools import cycle, repeat
from typing import Literal

TactileKind = Literal["none", "biotac"]


class TactileRequest(IntEnum):
    """Codes of the tactile data type; electrodes n = 1 to 24 follow as 3 + n."""

    NONE = 0
    PDC = 1
    TAC = 2
    TDC = 3


def electrode_request(number: int) -> int:
    """Code that asks for an electrode, 1 to 24, and the one after it."""
    return TactileRequest.TDC + number


BIOTAC_ROTATION: tuple[int, ...] = (
    int(TactileRequest.PDC),
    int(TactileRequest.TDC),
    *(electrode_request(number) for number in range(2, 25, 2)),
)
"""The 14 requests after which every value of a BioTac is known."""


class TactileRotation:
    """The request of each cycle for one kind of fingertip."""

    def __init__(self, kind: TactileKind) -> None:
        self._requests = cycle(BIOTAC_ROTATION) if kind == "biotac" else repeat(int(TactileRequest.NONE))

    def next(self) -> int:
        """The code to send in this cycle."""
        return next(self._requests)
