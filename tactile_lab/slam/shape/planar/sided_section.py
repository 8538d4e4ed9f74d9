"""Half the section of a solid of revolution that stands on a table, of straight and round sides: a cup, a tin, a bowl.

A smooth field over the section rounds off what is sharp, by three to five millimetres at the rim of a cup, and knows
nothing of how a wall goes on below its contacts. Sides are divided as those of an outline, along a line that begins
where the wall meets the table and ends on the axis.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.outlines import is_simple
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, order_along
from tactile_lab.slam.shape.planar.sided_line import Joint, SidedLine, joint_between
from tactile_lab.slam.shape.planar.sides import Side, divide_along
from tactile_lab.slam.shape.surfaces.surface import Contour

_INWARD = -0.3
"""Outward part of the normal of what faces the axis: the inner edge of a rim, no top."""
_UPWARD = 0.3
"""Least vertical part of the normal of a top."""
_LEAST_SLOPE = 0.6
"""Of a wall that goes down to the table: the sine of its angle to that."""
_RISES_m = 0.006
"""How much a top rises or sinks at most between its contacts and the axis."""
_UNSURE_SLOPE = 0.2
"""Below its lowest contact a wall may lean by so much more or less, as in the standing field."""
_EXPECTED_PER_m = 0.0
"""Fingers come to walls and to a top on different ways: that none came to the corner between them tells nothing."""
_CHECKED_EVERY_m = 0.002


class SidedSection(SidedLine):
    """Straight and round sides from the table up to the axis. Made by :meth:`of`.

    Args:
        contacts: at (distance from the axis, height).
        sides: in their order, the object on the left.
        floor_m: height of the table.

    Raises:
        ShapeError: the sides do not meet each other, the table and the axis.
    """

    def __init__(self, contacts: PlanarContacts, sides: list[Side], floor_m: float) -> None:
        outer, inner = _without_inner(sides, contacts)
        between = [joint_between(*pair, contacts, _EXPECTED_PER_m) for pair in pairwise(outer)]
        rim_m = float(contacts.points_m[:, 1].max()) if inner else None
        foot_m, top_m = _foot_m(outer[0], contacts, floor_m), _top_m(outer[-1], contacts, rim_m)
        super().__init__(contacts, outer, [Joint(foot_m), *between, Joint(top_m)], inner)
        self.floor_m = floor_m

    @classmethod
    def of(cls, contacts: PlanarContacts, provisional_m: Array, floor_m: float) -> Self:
        """The section with the least description length.

        Args:
            contacts: at (distance from the axis, height).
            provisional_m: half of a section that orders the contacts, from the axis on the table to its other end,
                shape (m, 2).
            floor_m: height of the table.

        Raises:
            ShapeError: as the class, or the sides do not enclose one region.
        """
        found = cls(contacts, divide_along(contacts, order_along(contacts, provisional_m)), floor_m)
        outline_m = found.contour(_CHECKED_EVERY_m).points_m
        if outline_m[:, 0].min() < 0 or not is_simple(outline_m):
            raise ShapeError("the sides do not enclose one region", hint="More contacts near the corners would help")
        return found

    @cached_property
    def _lowest_m(self) -> float:
        """Height of the lowest contact of the wall that goes down to the table."""
        return float(self.contacts.points_m[self.sides[0].members, 1].min())

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """Half the section, closed along the table and the axis; sigma as of an outline, and larger below the lowest
        contact.
        """
        points_m, sigma_m = self.points(resolution_m)
        below_m = np.maximum(0.0, self._lowest_m - points_m[:, 1])
        sigma_m = np.hypot(sigma_m, _UNSURE_SLOPE * below_m)
        reach_m, top_m = self.joints_m[-1]
        ends = [self.joints_m[-1:]] if reach_m == 0.0 else [self.joints_m[-1:], np.array([[0.0, top_m]])]
        points_m = np.vstack([[[0.0, self.floor_m]], points_m, *ends])
        return Contour(points_m, np.concatenate([sigma_m[:1], sigma_m, sigma_m[-1:].repeat(len(ends))]), is_closed=True)


def _foot_m(side: Side, contacts: PlanarContacts, floor_m: float) -> Array:
    """Where the first side meets the table, shape (2,). Raises ShapeError if it does not, or at a flat angle."""
    lowest_m = contacts.points_m[side.members[0]]
    place_m = _crossing_m(side, lowest_m, axis=1, value_m=floor_m)
    if place_m is None or abs(side.gradients(place_m[None])[0, 0]) < _LEAST_SLOPE or place_m[0] < 0:
        raise ShapeError("its wall does not meet the table", hint="More contacts near its foot would help")
    return place_m


def _without_inner(sides: list[Side], contacts: PlanarContacts) -> tuple[list[Side], list[Side]]:
    """The sides up to the last one that does not face the axis, and those after it: the inside of a rim."""
    faces_in = [bool(side.gradients(contacts.points_m[side.members[-1:]])[0, 0] < _INWARD) for side in sides]
    count = len(sides) - next((place for place, each in enumerate(reversed(faces_in)) if not each), len(sides))
    if count == 0:
        raise ShapeError("none of its sides faces outward")
    return sides[:count], sides[count:]


def _top_m(side: Side, contacts: PlanarContacts, rim_m: float | None) -> Array:
    """Where the last outer side meets the axis or, below a rim of this height, where it ends, shape (2,).

    Raises ShapeError if it is a wall without a rim.
    """
    end_m = side.feet_m(contacts.points_m[side.members[-1:]])[0]
    is_wall = bool(side.gradients(end_m[None])[0, 1] < _UPWARD)
    if is_wall and rim_m is None:
        raise ShapeError("its top was not touched")
    axis, value_m = (1, rim_m) if is_wall and rim_m is not None else (0, 0.0)
    place_m = _crossing_m(side, end_m, axis=axis, value_m=value_m)
    is_near = place_m is not None and abs(place_m[1] - end_m[1]) < _RISES_m
    return end_m if place_m is None or not is_near else place_m


def _crossing_m(side: Side, near_m: Array, *, axis: int, value_m: float) -> Array | None:
    """The place of a side, shape (2,), where a coordinate has a value, the nearest one to a place; None without one."""
    (bend, *slope, offset), other = side.numbers, 1 - axis
    fixed = value_m - side.origin_m[axis]
    roots = np.roots([bend, slope[other], bend * fixed**2 + slope[axis] * fixed + offset])
    real = np.real(roots[np.isreal(roots)]) + side.origin_m[other]
    if not len(real):
        return None
    found = np.full(2, value_m)
    found[other] = real[np.abs(real - near_m[other]).argmin()]
    return found
