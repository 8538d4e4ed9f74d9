"""What hand and fingertips measured while the object was held."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from drivers.core.contacts import FINGERS, Array
from drivers.core.fingertip import ContinuousFingertip

SAMPLE_ns = 10_000_000
"""Samples closer together than this (a hand's cycle may take 1 ms) say nothing more about a slow motion."""
_JITTER_ns = 1_000_000

LONGEST_SAMPLES = 6000
"""A minute; a person who leads the hand may hold the object as long as he likes."""


@dataclass(frozen=True)
class CarrySample:
    """The hand at one moment.

    Attributes:
        stamp_ns: arrival of the joint angles.
        joints_rad: shape (24,).
        world_T_forearm: homogeneous matrix, shape (4, 4).
        readings: of the fingertips, without bias, shape (5, 6); NaN without a valid one. Order of :data:`FINGERS`.
        motor_counts: of the motors' strain gauges, shape (20,); None where not all have reported.
    """

    stamp_ns: int
    joints_rad: Array
    world_T_forearm: Array
    readings: Array
    motor_counts: Array | None = None


@dataclass(frozen=True)
class CarrySamples:
    """The hand at n moments, in order; shapes as in :class:`CarrySample` with n in front.

    ``motor_counts`` are None where one of the samples has none.
    """

    stamps_ns: Array
    joints_rad: Array
    world_T_forearm: Array
    readings: Array
    motor_counts: Array | None = None

    @classmethod
    def of(cls, samples: list[CarrySample]) -> Self:
        """Samples as arrays; at least one."""
        motor_counts = [sample.motor_counts for sample in samples]
        return cls(
            np.array([sample.stamp_ns for sample in samples], dtype=float),
            np.array([sample.joints_rad for sample in samples]),
            np.array([sample.world_T_forearm for sample in samples]),
            np.array([sample.readings for sample in samples]),
            None if any(counts is None for counts in motor_counts) else np.array(motor_counts, dtype=float),
        )

    def until(self, stamp_ns: int) -> Self | None:
        """Those up to a moment; None if fewer than two."""
        count = int(np.searchsorted(self.stamps_ns, stamp_ns, side="right"))
        if count < 2:
            return None
        return type(self)(
            self.stamps_ns[:count],
            self.joints_rad[:count],
            self.world_T_forearm[:count],
            self.readings[:count],
            None if self.motor_counts is None else self.motor_counts[:count],
        )


class CarryRecord:
    """Keeps the samples since an object was grasped.

    Args:
        fingertips: that measure contacts while they move, by finger; without any, nothing is kept.
    """

    def __init__(self, fingertips: Mapping[str, ContinuousFingertip]) -> None:
        self._fingertips = dict(fingertips)
        self._samples: deque[CarrySample] = deque(maxlen=LONGEST_SAMPLES)
        self.is_open = False
        """Whether samples are wanted: an object is grasped."""

    def begin(self) -> None:
        """The fingers have closed around the object and rest."""
        self._samples.clear()
        self.is_open = bool(self._fingertips)

    def end(self) -> None:
        """The object is left alone."""
        self.is_open = False

    def take(self, stamp_ns: int, joints_rad: Array, world_T_forearm: Array, motor_counts: Array | None = None) -> None:
        """One sample of the hand, if it is not too soon after the last one."""
        if self._samples and stamp_ns - self._samples[-1].stamp_ns < SAMPLE_ns - _JITTER_ns:
            return
        readings = np.full((len(FINGERS), 6), np.nan)
        for finger, tip in self._fingertips.items():
            readings[FINGERS.index(finger)] = tip.reading()
        self._samples.append(CarrySample(stamp_ns, joints_rad, world_T_forearm, readings, motor_counts))

    def since(self, stamp_ns: int) -> CarrySamples | None:
        """The samples from a moment on; None if fewer than two, or if those of its beginning are not kept."""
        kept = [sample for sample in self._samples if sample.stamp_ns >= stamp_ns]
        if len(kept) < 2 or (kept[0] is self._samples[0] and kept[0].stamp_ns - stamp_ns > 20 * SAMPLE_ns):
            return None
        return CarrySamples.of(kept)
