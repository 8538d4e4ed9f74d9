"""What may be hidden at a corner that no contact is near: a further face may cut it off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from drivers.core.contacts import Array

HIDDEN_SHARE = 0.03
"""Share of corners between two known faces where a third face cuts the corner off, before any contact is seen."""

_MOST_UNSEEN = 50.0


@dataclass(frozen=True)
class CutCorner:
    """A corner, and the deepest cut that the contacts allow: straight from the last contact of one face to the first of
    the next.

    Attributes:
        gaps_m: from the corner to that contact on the face before, and on the face after.
        depth_m: distance of the corner from the deepest cut.
        chance: probability that the corner is cut. It is larger the more contacts would be expected on the long way
            around the corner, where there are none.
    """

    gaps_m: tuple[float, float]
    depth_m: float
    chance: float

    @classmethod
    def of(cls, corner_m: Array, ends_m: Array, contacts_per_m: float) -> Self:
        """From the corner, shape (2,), the ends of the deepest cut on both faces, shape (2, 2), and the contacts
        that lie on a metre of the outline.
        """
        to_ends = ends_m - corner_m
        before_m, after_m = (float(gap) for gap in np.linalg.norm(to_ends, axis=1))
        chord_m = float(np.linalg.norm(ends_m[1] - ends_m[0]))
        doubled_area = abs(float(to_ends[0, 0] * to_ends[1, 1] - to_ends[0, 1] * to_ends[1, 0]))
        unseen = min(contacts_per_m * (before_m + after_m - chord_m), _MOST_UNSEEN)
        odds = HIDDEN_SHARE / (1 - HIDDEN_SHARE) * np.exp(unseen)
        return cls((before_m, after_m), doubled_area / max(chord_m, 1e-9), float(odds / (1 + odds)))

    def variance_m2(self, away_m: Array, *, after: bool) -> Array:
        """Mean square distance of the outline's places on a face from a cut, anywhere between none and the deepest one.

        Args:
            away_m: of each place from the corner, shape (q,).
            after: on the face after the corner, not on the one before.
        """
        gap_m = max(self.gaps_m[after], 1e-9)
        depth_m = self.depth_m * np.clip(1 - away_m / gap_m, 0.0, 1.0)
        return np.asarray(self.chance * depth_m**2 / 3)
