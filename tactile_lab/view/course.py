"""What a page plots over time: the fingertips' forces, and how uncertain the estimate is from grasp to grasp."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array

SHOWN_s = 60.0
_ON_TABLE = 3
_STEP_ns = NANOSECONDS // 5
"""Forces closer in time than this are one point of the plot: a page draws some hundred points, not thousands."""


@dataclass(frozen=True)
class ShownUncertainty:
    """The estimate's standard deviations after a grasp: position (mm), rotation (degrees), median of the surface (mm).

    NaN where unknown.
    """

    position_mm: float = math.nan
    rotation_deg: float = math.nan
    surface_mm: float = math.nan


@dataclass
class ShownCourse:
    """The newest minute of forces, and the uncertainty at each grasp.

    Attributes:
        forces: session clock in nanoseconds, and the force on each fingertip; None without a usable reading.
        uncertainty: by number of the grasp.
    """

    forces: deque[tuple[int, Mapping[str, float | None]]] = field(default_factory=deque)
    uncertainty: dict[int, ShownUncertainty] = field(default_factory=dict)

    def take_forces(self, stamp_ns: int, loads_N: Mapping[str, float | None]) -> None:
        """Add a reading. If the clock goes back, as in another session, the course restarts."""
        if self.forces and stamp_ns < self.forces[-1][0]:
            self.forces.clear()
        if self.forces and stamp_ns - self.forces[-1][0] < _STEP_ns:
            return
        self.forces.append((stamp_ns, dict(loads_N)))
        while stamp_ns - self.forces[0][0] > SHOWN_s * NANOSECONDS:
            self.forces.popleft()

    def take_pose(self, grasp: int, covariance: Array | None) -> None:
        """Add the uncertainty of a grasp's pose; grasps after it were undone.

        Args:
            grasp: its number, from 0.
            covariance: of (x, y, yaw), shape (3, 3), or of position and rotation vector, shape (6, 6).
        """
        self.uncertainty = {number: kept for number, kept in self.uncertainty.items() if number < grasp}
        before = ShownUncertainty()
        if covariance is not None:
            variances, places = np.diag(covariance), 2 if len(covariance) == _ON_TABLE else 3
            position_mm = 1e3 * math.sqrt(max(float(variances[:places].sum()), 0.0))
            rotation_deg = math.degrees(math.sqrt(max(float(variances[places:].sum()), 0.0)))
            before = ShownUncertainty(position_mm, rotation_deg)
        self.uncertainty[grasp] = before

    def take_surface(self, sigma_m: Array) -> None:
        """Add the surface's median standard deviation to the newest grasp."""
        if self.uncertainty and len(sigma_m):
            newest = max(self.uncertainty)
            known = self.uncertainty[newest]
            median_mm = 1e3 * float(np.median(sigma_m))
            self.uncertainty[newest] = ShownUncertainty(known.position_mm, known.rotation_deg, median_mm)

    def force_table(self, fingers: tuple[str, ...]) -> tuple[Array, ...]:
        """Seconds before now, then the force on each of these fingertips (NaN where unknown), each of shape (n,)."""
        if not self.forces:
            return tuple(np.full((1 + len(fingers), 1), math.nan))
        stamps = np.array([stamp for stamp, _ in self.forces], dtype=float)
        columns = [[_number(loads.get(finger)) for _, loads in self.forces] for finger in fingers]
        return (stamps - stamps[-1]) / NANOSECONDS, *map(np.array, columns)

    def uncertainty_table(self) -> tuple[Array, ...]:
        """Number of each grasp from 1, then the three standard deviations, each of shape (n,)."""
        rows = [
            (number + 1, known.position_mm, known.rotation_deg, known.surface_mm)
            for number, known in sorted(self.uncertainty.items())
        ]
        return tuple(np.array(rows or [(1, math.nan, math.nan, math.nan)], dtype=float).T)


def _number(value: float | None) -> float:
    return math.nan if value is None else value
