"""What stands, storey by storey: a foot that was touched low says little of how wide the object is above it.

A box around all contacts keeps the hand away from the upper part of what leans inward or is stepped: from a pyramid's
slopes, a bottle's neck, a clock on its base. Here each side reaches at every height as far as contacts at that height
and above say. So storeys become narrower upward, as boxes inside one another that all stand on the table.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from sessions.motion.probing.bounding_box import BoundingBox
from tactile_lab.autonomy.standing.side_clearance import StandingBox

_FACES = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
"""Outward directions of a box's sides in its own axes."""

_SQUARELY = np.cos(np.radians(20.0))
"""A contact that faces a side at least so well tells how far that side reaches, also where the object is round."""

_MIDDLE = 0.6
"""Of the half width of a side: farther aside a contact may lie on a handle, or beside what is round."""

_LEDGE_m = 0.004
"""A storey is narrower than the one below it by at least so much on one side."""


@dataclass(frozen=True)
class Storeys:
    """An upright solid that nowhere becomes wider upward.

    Attributes:
        boxes: that stand on the table, each taller and nowhere wider than the one before; their union is the solid.
    """

    boxes: tuple[StandingBox, ...]

    def at(self, height_m: float) -> StandingBox:
        """The box whose sides are met at a height; above the top the uppermost."""
        return next((box for box in self.boxes if height_m <= box.size_m[2]), self.boxes[-1])

    def grow(self, side_m: float, top_m: float) -> Storeys:
        """With every side farther out, and every top higher; less where that is negative."""
        return Storeys(tuple(box.grow(side_m, top_m) for box in self.boxes))

    def distances_m(self, places_m: Array) -> Array:
        """Of world places (..., 3) to its surface, negative inside, shape (...)."""
        return np.asarray(np.min([box.distances_m(places_m) for box in self.boxes], axis=0))


def storeys_of(box: BoundingBox, points_m: Array, normals: Array, beside: NDArray[np.bool_]) -> Storeys:
    """The storeys that contacts on sides tell; one alone where there are none. All contacts lie inside or on them.

    Between two contacts in the middle of a side it reaches as far as the lower one, or any above that; over the highest
    as far as that one, and below the lowest as far as the box.

    Args:
        box: around all contacts.
        points_m, normals: of all contacts, shape (n, 3) each, world frame.
        beside: which of them are on the outside of sides, shape (n,).
    """
    heights_m, reach_m = points_m[:, 2], np.concatenate([box.high_m, -box.low_m])
    out_m, tells = _on_faces(box, points_m, normals)
    tells &= beside[:, None]
    found = [(0.0, reach_m)]
    for floor_m in np.sort(heights_m[tells.any(axis=1) & (heights_m < (box.top_m or 0.0))]).tolist():
        lower = tells & (heights_m[:, None] <= floor_m)
        last_m = np.where(lower, heights_m[:, None], -np.inf).max(axis=0)
        told_m = np.where(heights_m[:, None] >= last_m, out_m, -np.inf).max(axis=0)
        above_m = np.minimum(np.where(lower.any(axis=0), told_m, reach_m), found[-1][1])
        if (found[-1][1] - above_m).max() > _LEDGE_m:
            found.append((floor_m, above_m))
    tops_m = [*(floor_m for floor_m, _ in found[1:]), box.top_m or 0.0]
    return Storeys(tuple(_standing(box, reach, top) for (_, reach), top in zip(found, tops_m, strict=True)))


def _on_faces(box: BoundingBox, points_m: Array, normals: Array) -> tuple[Array, NDArray[np.bool_]]:
    """How far out contacts lie on each side, from the origin of the box's axes, and which tell how far it reaches.

    Args:
        box: its axes.
        points_m, normals: shape (n, 3) each, world frame.

    Returns:
        Two arrays of shape (n, 4).
    """
    theta = box.world_T_box.theta()
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    own_m = (points_m[:, :2] - box.world_T_box.translation()) @ turn
    level = normals[:, :2] / np.maximum(np.linalg.norm(normals[:, :2], axis=1, keepdims=True), 1e-9)
    aside = np.abs(own_m - (box.low_m + box.high_m) / 2) / np.maximum((box.high_m - box.low_m) / 2, 1e-9)
    in_middle = aside[:, [1, 0, 1, 0]] < _MIDDLE
    return own_m @ _FACES.T, (level @ turn @ _FACES.T > _SQUARELY) & in_middle


def _standing(box: BoundingBox, reach_m: Array, top_m: float) -> StandingBox:
    """A box that reaches so far from the origin of another's axes, shape (4,), up to a height."""
    low_m, high_m = -reach_m[2:], reach_m[:2]
    as_felt = replace(box, low_m=low_m, high_m=np.maximum(high_m, low_m), top_m=top_m)
    x, y = as_felt.centre_world_m
    length_m, width_m = (as_felt.high_m - as_felt.low_m).tolist()
    return StandingBox(float(x), float(y), as_felt.world_T_box.theta(), (length_m, width_m, top_m))
