"""A lens's distortion in OpenCV's model: radial (also as a fraction), tangential, of thin prisms, of a tilted sensor.

Coefficients in OpenCV's order: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, and the sensor's angles tau_x, tau_y. A
point (x, y) at a distance of one before the lens goes, with ``r2 = x^2 + y^2``, to::

    x' = x f + 2 p1 x y + p2 (r2 + 2 x^2) + s1 r2 + s2 r2^2      f = (1 + k1 r2 + k2 r2^2 + k3 r2^3)
    y' = y f + p1 (r2 + 2 y^2) + 2 p2 x y + s3 r2 + s4 r2^2        / (1 + k4 r2 + k5 r2^2 + k6 r2^3)

and from there onto the tilted sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from drivers.core.contacts import Array

_COEFFICIENTS = 14
_ROUNDS, _ENOUGH_px = 40, 1e-9
"""OpenCV's default of five rounds leaves an error of half a pixel at the edge of a wide picture."""


@dataclass(frozen=True)
class Distortion:
    """The distortion of a lens.

    Attributes:
        given: up to 14 coefficients; missing ones are zero.
    """

    given: Sequence[float]

    def distorted(self, points: Array) -> Array:
        """Where points (n, 2) at a distance of one appear, shape (n, 2)."""
        factor, shift = self._bending(points)
        return self._onto_sensor(points * factor + shift, self._tilt)

    def slopes(self, points: Array) -> Array:
        """Derivatives of :meth:`distorted` with respect to the points, shape (n, 2, 2)."""
        _, _, p1, p2, _, _, _, _, s1, s2, s3, s4, _, _ = self._all
        x, y = points.T
        r2 = _r2(points)
        factor, by_r2 = self._factor(r2), self._factor_slope(r2)
        prism_x, prism_y = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
        across = 2 * x * y * by_r2 + 2 * (p1 * x + p2 * y)
        rows = [
            [factor + 2 * x * x * by_r2 + 2 * p1 * y + 6 * p2 * x + prism_x * x, across + prism_x * y],
            [across + prism_y * x, factor + 2 * y * y * by_r2 + 6 * p1 * y + 2 * p2 * x + prism_y * y],
        ]
        slopes = np.array(rows).transpose(2, 0, 1)
        if self._tilt is None:
            return slopes
        bent = points * factor[:, None] + self._shift(points)
        return np.asarray(_slopes_on_sensor(bent, self._tilt) @ slopes)

    def undistorted(self, pixels: Array, focal_px: Array, centre_px: Array) -> Array:
        """The points (n, 2) at a distance of one that appear at pixels (n, 2).

        Each point is divided by its factor until it appears within a billionth of a pixel of where it should.
        """
        wanted = (pixels - centre_px) / focal_px
        if self._tilt is not None:
            wanted = self._onto_sensor(wanted, np.asarray(np.linalg.inv(self._tilt), float))
        points = wanted.copy()
        if not any(self.given):
            return points
        moving, aim, now = np.arange(len(points)), wanted, points
        factor, shift = self._bending(now)
        for _ in range(_ROUNDS):
            now = np.where(factor > 0.0, (aim - shift) / factor, aim)
            points[moving], right = now, factor[:, 0] > 0.0
            factor, shift = self._bending(now)
            beside_px = self._onto_sensor(now * factor + shift, self._tilt) * focal_px + centre_px - pixels[moving]
            far = np.sqrt(beside_px[:, 0] ** 2 + beside_px[:, 1] ** 2) >= _ENOUGH_px
            keep = far & right
            moving, aim, factor, shift = moving[keep], aim[keep], factor[keep], shift[keep]
            if not len(moving):
                break
        return points

    def _bending(self, points: Array) -> tuple[Array, Array]:
        """What points (n, 2) are multiplied with, shape (n, 1), and what is added then, shape (n, 2)."""
        return self._factor(_r2(points))[:, None], self._shift(points)

    @cached_property
    def _all(self) -> tuple[float, ...]:
        return (*self.given, *(0.0,) * (_COEFFICIENTS - len(self.given)))

    def _factor(self, r2: Array) -> Array:
        k1, k2, _, _, k3, k4, k5, k6 = self._all[:8]
        above = 1 + ((k3 * r2 + k2) * r2 + k1) * r2
        return np.asarray(above / (1 + ((k6 * r2 + k5) * r2 + k4) * r2))

    def _factor_slope(self, r2: Array) -> Array:
        """Derivative of the factor with respect to ``r2``."""
        k1, k2, _, _, k3, k4, k5, k6 = self._all[:8]
        below = 1 + ((k6 * r2 + k5) * r2 + k4) * r2
        by_above = (3 * k3 * r2 + 2 * k2) * r2 + k1
        by_below = (3 * k6 * r2 + 2 * k5) * r2 + k4
        return np.asarray((by_above - self._factor(r2) * by_below) / below)

    def _shift(self, points: Array) -> Array:
        """What is added to points (n, 2) after their multiplication."""
        if not self._shifts:
            return np.zeros_like(points)
        _, _, p1, p2, _, _, _, _, s1, s2, s3, s4, _, _ = self._all
        x, y = points.T
        r2, crosswise = _r2(points), 2 * x * y
        across = p1 * crosswise + p2 * (r2 + 2 * x * x) + (s1 + s2 * r2) * r2
        down = p1 * (r2 + 2 * y * y) + p2 * crosswise + (s3 + s4 * r2) * r2
        return np.stack([across, down], axis=1)

    @cached_property
    def _shifts(self) -> bool:
        """Whether the lens does more than multiply."""
        return any(self._all[2:4]) or any(self._all[8:12])

    @cached_property
    def _tilt(self) -> Array | None:
        """The perspective mapping onto the tilted sensor, shape (3, 3); None for one that is not tilted."""
        tau_x, tau_y = self._all[12:]
        if not (tau_x or tau_y):
            return None
        (sx, sy), (cx, cy) = np.sin([tau_x, tau_y]), np.cos([tau_x, tau_y])
        about_x = np.array([[1.0, 0, 0], [0, cx, sx], [0, -sx, cx]])
        about_y = np.array([[cy, 0.0, -sy], [0, 1, 0], [sy, 0, cy]])
        turn = about_y @ about_x
        projection = np.array([[turn[2, 2], 0.0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]])
        return np.asarray(projection @ turn)

    @staticmethod
    def _onto_sensor(points: Array, mapping: Array | None) -> Array:
        if mapping is None:
            return points
        seen = points @ mapping[:, :2].T + mapping[:, 2]
        return np.asarray(seen[:, :2] / seen[:, 2:])


def _slopes_on_sensor(points: Array, mapping: Array) -> Array:
    """Derivatives of a perspective mapping at points (n, 2), shape (n, 2, 2)."""
    seen = points @ mapping[:, :2].T + mapping[:, 2]
    onto = seen[:, :2] / seen[:, 2:]
    return np.asarray((mapping[:2, :2] - onto[:, :, None] * mapping[2, :2]) / seen[:, 2:, None])


def _r2(points: Array) -> Array:
    return np.asarray(points[:, 0] ** 2 + points[:, 1] ** 2)
