"""The newest readings of a BioTac's channels, each received at its own time, and their means over a capture."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from drivers.biotac.slot_codec import LARGEST_COUNT, Channel, Slot
from drivers.core.contacts import Array


class Channels:
    """Readings by channel. A value outside the converter's range is not a reading: it shows that no sensor is fitted.

    Args:
        channels: the channels of this model; others are ignored.
        depth: how many readings of each are kept.
    """

    def __init__(self, channels: Sequence[int], depth: int) -> None:
        self._readings: dict[int, deque[int]] = {int(channel): deque(maxlen=depth) for channel in channels}
        self._stamps_ns: dict[int, int] = {}
        self._impossible: dict[int, bool] = {}
        self._sums: dict[int, tuple[int, int]] = {}
        self.newest_ns = 0
        """Stamp of the newest slot."""
        self.vibration: tuple[int, ...] = ()
        """The newest readings of the vibration channel (PAC), at most two, counts."""

    def take(self, slot: Slot, stamp_ns: int) -> None:
        """Store the readings of one slot."""
        self.newest_ns = stamp_ns
        self.vibration = slot.vibration or self.vibration
        for channel, value in slot.values.items():
            if channel in self._readings:
                self._take(channel, value, stamp_ns)

    def _take(self, channel: int, value: int, stamp_ns: int) -> None:
        dead = channel in (Channel.PDC, Channel.TDC) and value == 0  # never zero on a powered sensor
        self._impossible[channel] = dead or value > LARGEST_COUNT
        self._stamps_ns[channel] = stamp_ns
        if not self._impossible[channel]:
            self._readings[channel].append(value)
            count, total = self._sums.get(channel, (0, 0))
            self._sums[channel] = (count + 1, total + value)

    @property
    def heard(self) -> bool:
        """Whether anything has been received."""
        return bool(self._stamps_ns)

    @property
    def fitted(self) -> bool:
        """Whether the newest readings can come from a sensor: an empty socket shows values that no converter
        produces.
        """
        return self.heard and not any(self._impossible.values())

    @property
    def captured(self) -> bool:
        """Whether every electrode and the pressure have been received since the capture began."""
        return all(channel in self._sums for channel in self._readings if channel not in (Channel.TAC, Channel.TDC))

    def begin_capture(self) -> None:
        """Start new means."""
        self._sums.clear()

    def captured_means(self, channels: Sequence[int]) -> Array:
        """Mean of each channel since the capture began, counts; only when :attr:`captured`."""
        return np.array([self._sums[channel][1] / self._sums[channel][0] for channel in channels])

    def recent(self, channel: int) -> Array:
        """The newest readings of a channel, oldest first, counts."""
        return np.array(self._readings[channel], float)

    def newest(self, channels: Sequence[int]) -> Array:
        """Newest reading of each channel, counts; each channel must have been received."""
        return np.array([self._readings[channel][-1] for channel in channels], float)

    def older_than(self, age_ms: float) -> int:
        """How many channels were last received longer ago than this, relative to the newest slot's stamp."""
        limit_ns = self.newest_ns - age_ms * 1e6
        return sum(self._stamps_ns.get(channel, 0) < limit_ns for channel in self._readings)


def core_temperature_degC(counts: Array) -> Array:
    """Temperature of the heated core from counts of the TDC channel (n,), degrees Celsius, shape (n,).

    Approximate: only changes are meaningful (manufacturer's manual; protocols: BioTac units).
    """
    share = np.asarray(counts, float) / LARGEST_COUNT
    with np.errstate(divide="ignore"):
        return np.asarray(4025.0 / np.log((155183.0 - 46555.0 * share) / share) - 273.15)
