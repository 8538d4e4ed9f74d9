"""The bounding box of an object, as far as it was felt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array

SIDES = ("left", "front", "right", "back")
"""Sides besides the top, in the order of thesis figure 4.2; the front faces away from the arm."""


@dataclass(frozen=True)
class BoundingBox:
    """The measured box.

    Attributes:
        world_T_box: its axes: x away from the arm. It moves with the object.
        low_m, high_m: its extent there, without margin, shape (2,).
        margin_m: additional margin.
        top_m: height of the top; None if it was not found.
        missing: the sides that were not found, and why.
        has_sides: whether sides were looked for at all; else only the top counts.
    """

    world_T_box: Pose2
    low_m: Array
    high_m: Array
    margin_m: float
    top_m: float | None
    missing: Mapping[str, str]
    has_sides: bool = True

    @property
    def is_found(self) -> bool:
        """Whether anything was found."""
        return self.top_m is not None or len(self.missing) < len(SIDES)

    @property
    def centre_world_m(self) -> Array:
        """Its middle in the world, shape (2,)."""
        return np.asarray(self.world_T_box.transformFrom((self.low_m + self.high_m) / 2))

    def move(self, motion: Pose2) -> BoundingBox:
        """After the object was carried."""
        return replace(self, world_T_box=motion * self.world_T_box)

    def is_clear(self, points_world_m: Array) -> bool:
        """Whether places, shape (n, 2), all lie outside of the box and its margin."""
        places = np.array([self.world_T_box.transformTo(point) for point in points_world_m])
        low, high = self.low_m - self.margin_m, self.high_m + self.margin_m
        return bool(np.all(np.any((places < low) | (places > high), axis=1)))

    def in_words(self) -> str:
        """Size and what is missing, for people."""
        length, width = 1e3 * (self.high_m - self.low_m)
        top = "top not found" if self.top_m is None else f"{1e3 * self.top_m:.0f} mm high"
        if not self.has_sides:
            return f"the object is {top}" if self.is_found else "nothing was felt on the table"
        missing = "".join(f"; {side} not found: {why}" for side, why in self.missing.items())
        return f"bounding box {length:.0f} x {width:.0f} mm, {top}{missing}"
