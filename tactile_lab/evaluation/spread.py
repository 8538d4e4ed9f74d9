"""Spreads of metrics over runs, and confidence intervals of their means."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

CONFIDENCE = 0.95
_RESAMPLED, _LEAST_RESAMPLED = 2000, 5
"""Number of bootstrap samples, and minimum number of values."""


@dataclass(frozen=True)
class Spread:
    """Median, ninetieth percentile and maximum; infinite if too many runs have no value."""

    median: float
    p90: float
    largest: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of at least one value, which may be infinite."""
        return cls(quantile(values, 0.5), quantile(values, 0.9), max(values))

    @classmethod
    def of_known(cls, values: Iterable[float | None]) -> Spread | None:
        """Of the known values; None if there are none."""
        known = [value for value in values if value is not None]
        return cls.of(known) if known else None

    def text(self, digits: int = 1) -> str:
        """The three numbers, separated by slashes."""
        return " / ".join(number(value, digits) for value in (self.median, self.p90, self.largest))

    def as_json(self) -> dict[str, float | None]:
        """Plain data; infinite becomes None."""
        values = {"median": self.median, "p90": self.p90, "max": self.largest}
        return {name: value if math.isfinite(value) else None for name, value in values.items()}


@dataclass(frozen=True)
class Interval:
    """A mean and its 95 % confidence interval by Student's t; the interval is None for a single value."""

    mean: float
    low: float | None
    high: float | None

    @classmethod
    def of(cls, values: Sequence[float]) -> Interval:
        """Of at least one value."""
        count = len(values)
        mean = math.fsum(values) / count
        if count < 2:
            return cls(mean, None, None)
        deviation = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (count - 1))
        half = float(stdtrit(count - 1, (1 + CONFIDENCE) / 2)) * deviation / math.sqrt(count)
        return cls(mean, mean - half, mean + half)

    @classmethod
    def resampled(cls, values: Sequence[float]) -> Interval:
        """Of at least one value, by the bootstrap, because differences that are mostly zero are not normally
        distributed. The interval is None for fewer than five values.
        """
        found = np.asarray(values, dtype=float)
        if len(found) < _LEAST_RESAMPLED:
            return cls(float(found.mean()), None, None)
        drawn = np.random.default_rng(0).integers(len(found), size=(_RESAMPLED, len(found)))
        low, high = np.quantile(found[drawn].mean(axis=1), [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
        return cls(float(found.mean()), float(low), float(high))

    def excludes_zero(self, margin: float = 0.0) -> bool:
        """Whether zero is outside the interval, by more than a margin."""
        return self.low is not None and self.high is not None and (self.low > margin or self.high < -margin)

    def text(self, digits: int = 1) -> str:
        """Mean and interval."""
        if self.low is None or self.high is None:
            return number(self.mean, digits)
        return f"{number(self.mean, digits)} [{number(self.low, digits)}, {number(self.high, digits)}]"


def quantile(values: Sequence[float], share: float) -> float:
    """Linear between the sorted values; infinite if an infinite value is involved."""
    ordered = sorted(values)
    place = share * (len(ordered) - 1)
    low, part = ordered[math.floor(place)], place - math.floor(place)
    return low if part == 0.0 else low + part * (ordered[math.ceil(place)] - low) if math.isfinite(low) else math.inf


def number(value: float, digits: int) -> str:
    """A number with this many decimals."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "∞"
