"""Offset between the stamps of camera and hand, from the object's motion while the hand holds it.

A held object moves with the palm. With the correct offset its position in the palm's frame is the same in every picture
of a hold; with a wrong one it varies, the more the faster the hand moves. The offset minimizes this variation; its
standard deviation follows from the curvature at the minimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from drivers.core.contacts import Array

_RANGES_s, _STEP_s = (0.3, 0.15), 0.005
"""Search ranges of the offset, larger first: pictures this close to the ends of a hold are left out."""
_FEWEST, _LEAST_MOTION_m = 8, 0.005


@dataclass(frozen=True, eq=False)
class Track:
    """Poses over time: stamps (n,) in seconds, positions (n, 3) in metres, rotation matrices (n, 3, 3); world frame."""

    stamps_s: Array
    places_m: Array
    rotations: Array


@dataclass(frozen=True)
class ClockOffset:
    """The estimated offset.

    Attributes:
        offset_ms: add it to a camera stamp to get the hand's time of the same moment; None if it cannot be determined.
        sigma_ms: its standard deviation.
        pictures: number of pictures of the moving object used.
        reason: why it cannot be determined, "" otherwise.
    """

    offset_ms: float | None
    sigma_ms: float | None
    pictures: int
    reason: str = ""


def clock_offset(palm: Track, stamps_s: Array, places_m: Array, holds_s: Sequence[tuple[float, float]]) -> ClockOffset:
    """The offset between a camera's clock and the hand's.

    Args:
        palm: the hand's trajectory.
        stamps_s, places_m: the object as the camera saw it, shapes (n,) and (n, 2): x and y in the world.
        holds_s: begin and end of each stretch in which the hand held the object.
    """
    groups, count = list[NDArray[np.intp]](), 0
    for range_s in _RANGES_s:
        pieces = [_piece(palm, stamps_s, places_m, hold, range_s) for hold in holds_s]
        groups = [rows for rows in pieces if len(rows) >= 3]
        if (count := sum(map(len, groups))) >= _FEWEST:
            break
    if count < _FEWEST:
        return ClockOffset(None, None, count, f"{count} pictures of the moving object, {_FEWEST} are needed")
    if max(float(np.ptp(places_m[rows], axis=0).max()) for rows in groups) < _LEAST_MOTION_m:
        return ClockOffset(None, None, count, "the object moved too little while it was held")
    offsets = np.arange(-range_s, range_s + _STEP_s / 2, _STEP_s)
    costs = np.array([_wandering(palm, stamps_s, places_m, groups, offset) for offset in offsets])
    best = int(np.argmin(costs))
    if best in (0, len(offsets) - 1):
        reason = f"no offset within {1e3 * range_s:.0f} ms makes camera and hand agree"
        return ClockOffset(None, None, count, reason)
    curve = np.polyfit(offsets[best - 1 : best + 2] - offsets[best], costs[best - 1 : best + 2], 2)
    variance_m2 = costs[best] / max(2 * count - 2 * len(groups) - 1, 1)
    sigma_s = np.sqrt(variance_m2 / max(curve[0], 1e-12))
    return ClockOffset(1e3 * float(offsets[best] - curve[1] / (2 * curve[0])), 1e3 * float(sigma_s), count)


def _piece(
    palm: Track, stamps_s: Array, places_m: Array, hold_s: tuple[float, float], range_s: float
) -> NDArray[np.intp]:
    """Indices of the pictures inside one hold for which the palm's pose is known."""
    low = max(hold_s[0], palm.stamps_s[0]) + range_s
    high = min(hold_s[1], palm.stamps_s[-1]) - range_s
    return np.flatnonzero((stamps_s >= low) & (stamps_s <= high) & np.isfinite(places_m).all(axis=1))


def _wandering(
    palm: Track, stamps_s: Array, places_m: Array, groups: Sequence[NDArray[np.intp]], offset_s: float
) -> float:
    """Sum of squared distances of the object from its mean position in the palm's frame, over all holds."""
    total = 0.0
    for rows in groups:
        turns, places = _at(palm, stamps_s[rows] + offset_s)
        seen = np.column_stack([places_m[rows], np.zeros(len(rows))])
        height = seen.copy()
        height[:, 2] = places[:, 2]  # the object's height is not looked at: its motion is in the plane
        in_palm = np.einsum("nji,nj->ni", turns, height - places)
        mean = in_palm.mean(axis=0)
        expected = places + np.einsum("nij,j->ni", turns, mean)
        total += float(np.sum((expected - seen)[:, :2] ** 2))
    return total


def _at(palm: Track, stamps_s: Array) -> tuple[Array, Array]:
    """Rotations and positions of the palm, interpolated between its samples."""
    inside = np.clip(stamps_s, palm.stamps_s[0], palm.stamps_s[-1])
    places = np.column_stack([np.interp(inside, palm.stamps_s, palm.places_m[:, axis]) for axis in range(3)])
    return Slerp(palm.stamps_s, Rotation.from_matrix(palm.rotations))(inside).as_matrix(), places
