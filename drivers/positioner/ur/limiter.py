"""Targets of a session become a stream that an arm can follow: within speed and acceleration, without a jump."""

from __future__ import annotations

import numpy as np

from drivers.core.contacts import Array

_BRAKING = 0.8
"""Share of the largest acceleration that braking is planned with, so that the steps of a cycle do not overshoot."""

_POSITION, _ROTATION = slice(0, 3), slice(3, 6)


class MotionLimiter:
    """Follows targets in the six coordinates of the mount.

    Position and rotation each move on their own straight line towards the target, as fast as speed, acceleration and
    the way that braking needs permit.

    Args:
        speeds: largest speed of position and rotation, m/s and rad/s.
        accelerations: the same, m/s^2 and rad/s^2.
        start: where the arm stands, shape (6,), metres and radians.
    """

    def __init__(self, speeds: tuple[float, float], accelerations: tuple[float, float], start: Array) -> None:
        self._limits = tuple(zip((_POSITION, _ROTATION), speeds, accelerations, strict=True))
        self.place = np.array(start, dtype=float)
        self.speed = np.zeros(6)

    def step(self, target: Array, duration_s: float) -> Array:
        """The next place on the way, shape (6,), after this time."""
        for part, speed, acceleration in self._limits:
            wanted = _wanted_speed(target[part] - self.place[part], speed, acceleration, duration_s)
            change = wanted - self.speed[part]
            largest = acceleration * duration_s
            self.speed[part] += change * min(1.0, largest / max(float(np.linalg.norm(change)), 1e-12))
        self.place = self.place + self.speed * duration_s
        return self.place

    def brake(self, duration_s: float) -> Array:
        """The next place while it comes to rest wherever that is, shape (6,)."""
        return self.step(self.place, duration_s)


def _wanted_speed(way: Array, speed: float, acceleration: float, duration_s: float) -> Array:
    """Velocity towards the end of a way, from which braking in time is possible."""
    length = float(np.linalg.norm(way))
    if length == 0.0:
        return np.zeros(3)
    fastest = min(speed, float(np.sqrt(2.0 * _BRAKING * acceleration * length)), length / duration_s)
    return way * (fastest / length)
