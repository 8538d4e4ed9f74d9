"""Prior means of the surface field (section 2.2.3): what is believed where nothing has been touched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from tactile_lab.geometry.contacts import Array


class PriorMean(Protocol):
    """A differentiable function of space, metres, positive outside the object."""

    def value(self, points_m: Array) -> Array:
        """Values, shape (n,)."""

    def gradient(self, points_m: Array) -> Array:
        """Gradients, shape (n, d)."""


class ZeroMean:
    """The thesis's default, (2.13): untouched space is believed to lie on the surface."""

    def value(self, points_m: Array) -> Array:
        return np.zeros(len(points_m))

    def gradient(self, points_m: Array) -> Array:
        return np.zeros_like(points_m)


@dataclass(frozen=True)
class OutwardMean:
    """Untouched space is believed to be outside, and the more so the farther from the data.

    ``sqrt(|x - centre|^2 + softness^2)``: a cone with a rounded tip, positive everywhere and of slope one far
    out like a distance, in place of the quadratic of (2.19), whose slope grows without bound.

    Attributes:
        centre_m: shape (d,), the middle of the data.
        softness_m: radius of the rounded tip, and the smallest value.
    """

    centre_m: Array
    softness_m: float

    @classmethod
    def around(cls, points_m: Array, softness_m: float) -> Self:
        """The prior for contacts of shape (n, d): centred between their extremes."""
        centre = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
        return cls(centre, softness_m)

    def value(self, points_m: Array) -> Array:
        squared = np.sum((points_m - self.centre_m) ** 2, axis=1)
        return np.asarray(np.sqrt(squared + self.softness_m**2))

    def gradient(self, points_m: Array) -> Array:
        return np.asarray((points_m - self.centre_m) / self.value(points_m)[:, None])
