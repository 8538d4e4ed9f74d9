"""Keeps the last cycles, to record them with a stop."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from drivers.core.contacts import Array

LAST_CYCLES = 100
"""Number of cycles kept."""


@dataclass(frozen=True)
class CycleSnapshot:
    """One cycle as the supervisor sees it.

    Attributes:
        stamp_ns: when the cycle began to read its devices, session clock. Everything that arrived before is included,
            however long reading took.
        hand_stamp_ns: arrival of the newest hand status; None before the first.
        loads_N: contact force on each fingertip; infinite if its readings are invalid.
        palm_world_m: origin of the palm, shape (3,), world; None before the first status.
        tip_stamps_ns: arrival of the newest reading of each fingertip with its own transport; None before the first.
        force_ranges_N: calibrated range of the fingertips' sensors, smallest axis.
        warmest_C: temperature of the hand's warmest motor; None while unknown.
        void_tips: why readings of fingertips are invalid, by finger.
    """

    stamp_ns: int
    hand_stamp_ns: int | None
    loads_N: Mapping[str, float]
    palm_world_m: Array | None
    tip_stamps_ns: Mapping[str, int | None] = field(default_factory=dict)
    force_ranges_N: Mapping[str, float] = field(default_factory=dict)
    warmest_C: float | None = None
    void_tips: Mapping[str, str] = field(default_factory=dict)

    def plain(self) -> dict[str, Any]:
        """As plain data; ages in milliseconds."""
        return {
            "stamp_ns": self.stamp_ns,
            "hand_age_ms": self._age_ms(self.hand_stamp_ns),
            "load_N": dict(self.loads_N),
            "void": dict(self.void_tips),
            "palm_world_m": None if self.palm_world_m is None else self.palm_world_m.tolist(),
            "tip_age_ms": {finger: self._age_ms(stamp_ns) for finger, stamp_ns in self.tip_stamps_ns.items()},
            "warmest_C": self.warmest_C,
        }

    def _age_ms(self, stamp_ns: int | None) -> float | None:
        return None if stamp_ns is None else (self.stamp_ns - stamp_ns) / 1e6


class FlightRecorder:
    """Keeps the newest cycles."""

    def __init__(self) -> None:
        self._cycles: deque[CycleSnapshot] = deque(maxlen=LAST_CYCLES)

    def note(self, snapshot: CycleSnapshot) -> None:
        """Keep a cycle, and drop the oldest."""
        self._cycles.append(snapshot)

    def plain(self) -> list[dict[str, Any]]:
        """The cycles as plain data, oldest first."""
        return [snapshot.plain() for snapshot in self._cycles]
