"""Slips by vibration: fingertips without forces hear that the object slides under them (BioTacs, channel PAC).

How long it slides under them does not tell how far it moves in the hand: fingers that stick to it yield with it
(decision 92).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, sqrt
from typing import Protocol, runtime_checkable

import numpy as np

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS

_WINDOW_ns = 40_000_000
"""The power of the vibration is compared over windows of this length: shorter ones hold few readings."""
_LEAST_RESTING, _LEAST_IN_WINDOW = 50, 10
"""Fewer readings than this tell neither a level nor a power; each sample of the hand brings two."""
_BEYOND = 6.0
"""A slip's power is beyond the resting one by so many standard deviations of a window's power."""
_LEAST_COUNTS = 1.0
"""Resting noise below the converter's step."""


@runtime_checkable
class VibratingFingertip(Protocol):
    """A fingertip that hears vibrations of its skin."""

    def vibration_at(self, stamp_ns: int) -> tuple[int, ...]:
        """The readings that came with the sample of this stamp, counts; empty for none."""


@dataclass(frozen=True)
class HeardSlip:
    """A slip of a held object that fingertips heard.

    Attributes:
        fingers: under which it slid.
        slipped_s: how long it slid under any of them.
    """

    fingers: tuple[str, ...]
    slipped_s: float

    def in_words(self) -> str:
        """The slip in words, for people."""
        last = f" and {self.fingers[-1]}" if len(self.fingers) > 1 else self.fingers[-1]
        return f"slips under {', '.join(self.fingers[:-1])}{last}, for {self.slipped_s:.1f} s"


class TipVibration:
    """The vibration of one fingertip, against its own level while the hand held still."""

    def __init__(self) -> None:
        self._still: list[int] = []
        self._window: list[int] = []
        self._middle, self._sigma = 0.0, 0.0

    def rest(self, readings: tuple[int, ...]) -> None:
        """Readings of the hand that holds still."""
        self._still.extend(readings)

    def take(self, readings: tuple[int, ...]) -> None:
        """Readings of the hand that carries."""
        self._window.extend(readings)

    def settle(self) -> None:
        """The hand has held still: its readings are the level."""
        still = np.array(self._still, dtype=float)
        self._middle = float(np.median(still)) if len(still) else 0.0
        scatter = float(np.abs(still - self._middle).mean()) if len(still) else 0.0
        self._sigma = max(sqrt(pi / 2) * scatter, _LEAST_COUNTS)

    def slips(self) -> bool:
        """Whether the window that ends now is louder than rest; a new one begins."""
        window, self._window = np.array(self._window, dtype=float), []
        if len(self._still) < _LEAST_RESTING or len(window) < _LEAST_IN_WINDOW:
            return False
        power = float(((window - self._middle) ** 2).mean()) / self._sigma**2
        return power > 1.0 + _BEYOND * sqrt(2 / len(window) + 2 / len(self._still))


class SlipHearing:
    """Hears slips from the capture of an object until its hold ends.

    Args:
        fingertips: those that hear vibrations, by finger; without any, nothing is heard.
    """

    def __init__(self, fingertips: Mapping[str, VibratingFingertip]) -> None:
        self._fingertips = fingertips
        self._tips: dict[str, TipVibration] = {}
        self._is_still = False
        self._fingers: set[str] = set()
        self._slipped_s, self._from_ns = 0.0, 0

    def on_still(self) -> None:
        """The fingers have closed, and hold still."""
        self._tips, self._is_still = {finger: TipVibration() for finger in self._fingertips}, True

    def on_carry(self, stamp_ns: int) -> None:
        """The hand may move the object from now on."""
        self._is_still, self._from_ns = False, stamp_ns
        self._fingers, self._slipped_s = set(), 0.0
        for tip in self._tips.values():
            tip.settle()

    def on_left(self) -> None:
        """The object is not held."""
        self._tips = {}

    def on_sample(self, stamp_ns: int) -> None:
        """A sample of the hand, which the fingertips have taken."""
        for finger, tip in self._tips.items():
            readings = self._fingertips[finger].vibration_at(stamp_ns)
            (tip.rest if self._is_still else tip.take)(readings)
        if self._tips and not self._is_still and stamp_ns - self._from_ns >= _WINDOW_ns:
            self._end_window(stamp_ns)

    def _end_window(self, stamp_ns: int) -> None:
        if slipping := {finger for finger, tip in self._tips.items() if tip.slips()}:
            self._fingers |= slipping
            self._slipped_s += (stamp_ns - self._from_ns) / NANOSECONDS
        self._from_ns = stamp_ns

    @property
    def slip(self) -> HeardSlip | None:
        """What was heard since the carry began; None for no slip."""
        if not self._fingers:
            return None
        return HeardSlip(tuple(finger for finger in FINGERS if finger in self._fingers), self._slipped_s)
