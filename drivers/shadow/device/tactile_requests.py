"""What the palm asks its fingertips for, cycle by cycle.

A BioTac answers each request with two values, the requested one and the next. Asking for the pressure (then also the
heater voltage follows), the temperature (with the first electrode) and every even electrode covers all 24 electrodes
in 14 cycles, as Shadow's own polling table does. The vibration channel comes twice with every answer. Besides, any kind
of fingertip can be asked who it is (:mod:`~drivers.shadow.protocol.tactile_names` reads the answers).
"""

from __future__ import annotations

from collections import deque
from enum import IntEnum
from itertools import cycle
from typing import Annotated, TypeAlias

from pydantic import AfterValidator

from drivers.core.registry import Registry


class TactileRequest(IntEnum):
    """Codes of the tactile data type; electrodes n = 1 to 24 follow as 3 + n."""

    NONE = 0
    PDC = 1
    TAC = 2
    TDC = 3


class TactileQuestion(IntEnum):
    """Codes that ask fingertips of any kind who they are (protocols: Fingertip questions)."""

    PROTOCOL = 0xFFF9
    FREQUENCY = 0xFFFA
    MANUFACTURER = 0xFFFB
    SERIAL = 0xFFFC
    SOFTWARE = 0xFFFD
    BOARD = 0xFFFE


class TactileProtocol(IntEnum):
    """Kinds of fingertips, as they answer to :attr:`TactileQuestion.PROTOCOL`."""

    NONE = 0
    PST3 = 1
    BIOTAC = 2
    UBI0 = 3
    MST = 4
    CONFLICTING = 0xFFFF


def electrode_request(number: int) -> int:
    """Code that asks for an electrode, 1 to 24, and the one after it."""
    return TactileRequest.TDC + number


BIOTAC_ROTATION: tuple[int, ...] = (
    int(TactileRequest.PDC),
    int(TactileRequest.TDC),
    *(electrode_request(number) for number in range(2, 25, 2)),
)
"""The 14 requests after which every value of a BioTac is known."""

ROTATIONS: Registry[tuple[int, ...]] = Registry("tactile rotation", form=tuple)
"""What the palm asks its fingertips for, cycle by cycle and over again, by the kind of fingertip."""

ROTATIONS.register("none", (int(TactileRequest.NONE),))
ROTATIONS.register("biotac", BIOTAC_ROTATION)

TactileKind: TypeAlias = Annotated[str, AfterValidator(ROTATIONS.known)]

_ASKED_TIMES = 3  # an answer may be lost


class TactileRotation:
    """The request of each cycle.

    Args:
        kind: of the fingertips.
        names: ask first who they are, in every second cycle.
    """

    def __init__(self, kind: TactileKind, *, names: bool = False) -> None:
        self._requests = cycle(ROTATIONS[kind])
        self._questions = deque(map(int, tuple(TactileQuestion) * _ASKED_TIMES if names else ()))
        self._question_is_next = True

    def next(self) -> int:
        """The code to send in this cycle."""
        self._question_is_next = not self._question_is_next
        if self._questions and self._question_is_next:
            return self._questions.popleft()
        return next(self._requests)
