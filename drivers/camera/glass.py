"""Refraction in the table's glass: a ray leaves the plate in its old direction, but displaced sideways.

The camera looks up through a plate whose upper side is the table, z = 0. A straight continuation of the ray meets the
table farther out than the refracted ray does, by thickness * (tan incidence - tan refraction): 0.9 mm for 8 mm of glass
at 19 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array


@dataclass(frozen=True)
class Glass:
    """A horizontal plate; ``thickness_m`` is 0 if there is none."""

    thickness_m: float = 0.0
    index: float = 1.5

    def shift(self, slope: Array) -> Array:
        """Intersection of straight rays with the table minus that of the refracted rays, shape (n, 2), metres.

        Args:
            slope: horizontal over vertical part of each ray's direction below the glass, shape (n, 2).
        """
        tangent_squared = np.sum(slope**2, axis=-1, keepdims=True)
        sine_squared = tangent_squared / (1.0 + tangent_squared) / self.index**2
        cosine_ratio = np.sqrt((1.0 + tangent_squared) * (1.0 - sine_squared))
        return np.asarray(self.thickness_m * slope * (1.0 - 1.0 / (self.index * cosine_ratio)))

    def apparent(self, points_world_m: Array, camera_world_m: Array) -> Array:
        """Apparent positions of points (n, 3) on the table for a camera below it, shape (n, 3).

        The slope is that of the straight line to the true point: an error of a few micrometres.
        """
        seen = points_world_m - camera_world_m
        moved = np.array(points_world_m)
        moved[:, :2] += self.shift(seen[:, :2] / seen[:, 2:])
        return moved
