"""An outline of straight and round sides that meet in corners or go over into each other."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.outlines import is_simple
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, order_along
from tactile_lab.slam.shape.planar.sided_line import SidedLine, joint_between
from tactile_lab.slam.shape.planar.sides import Side, divide_into_sides
from tactile_lab.slam.shape.surfaces.sampling import polygon_area
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_REORDERINGS = 2
_CHECKED_EVERY_m = 0.002


class RoundedOutline(SidedLine):
    """Straight and round sides, counter-clockwise; a :class:`FittedShape`. Made by :meth:`of`.

    Attributes:
        name: "rounded".
    """

    name = "rounded"

    def __init__(self, contacts: PlanarContacts, sides: list[Side]) -> None:
        ring_m = contacts.points_m[np.concatenate([side.members for side in sides])]
        length_m = float(np.linalg.norm(np.diff(ring_m, axis=0, append=ring_m[:1]), axis=1).sum())
        per_m = len(contacts) / max(length_m, 1e-9)
        pairs = zip([sides[-1], *sides[:-1]], sides, strict=True) if len(sides) > 1 else ()
        super().__init__(contacts, sides, [joint_between(*pair, contacts, per_m) for pair in pairs])

    @classmethod
    def of(cls, contacts: PlanarContacts, provisional_m: Array) -> Self:
        """The outline with the least description length.

        Args:
            contacts: in the plane.
            provisional_m: a closed outline that orders the contacts, shape (m, 2).

        Raises:
            ShapeError: no side is round, or the sides do not enclose one region.
        """
        found = cls._ordered(contacts, provisional_m)
        for _ in range(_REORDERINGS):
            try:
                again = cls._ordered(contacts, found.outline_m)
            except ShapeError:  # the first order was the better one
                break
            if again.log_evidence <= found.log_evidence + 1e-9:
                break
            found = again
        return found

    @classmethod
    def _ordered(cls, contacts: PlanarContacts, ring_m: Array) -> Self:
        """The outline of contacts in their order along a closed line. Raises ShapeError."""
        sides = divide_into_sides(contacts, order_along(contacts, ring_m))
        if not any(side.is_round for side in sides):
            raise ShapeError("no side is round", hint="Faces describe it")
        found = cls(contacts, sides)
        if len(found.outline_m) < 3 or polygon_area(found.outline_m) <= 0 or not is_simple(found.outline_m):
            raise ShapeError("the sides do not enclose one region", hint="More contacts near the corners would help")
        return found

    @cached_property
    def outline_m(self) -> Array:
        """The outline as a closed polygon, counter-clockwise, shape (k, 2)."""
        return self.contour(_CHECKED_EVERY_m).points_m

    @property
    def misfits(self) -> tuple[Array, Array]:
        """As :attr:`.Polygon.misfits`, of each contact's own side."""
        across_m, turned_rad = np.zeros(len(self.contacts)), np.zeros(len(self.contacts))
        for side in self.sides:
            points_m, normals = self.contacts.points_m[side.members], self.contacts.normals[side.members]
            outward = side.gradients(points_m)
            cosine = np.sum(outward * normals, axis=1) / np.linalg.norm(outward, axis=1).clip(1e-12)
            across_m[side.members] = np.abs(side.values_m(points_m))
            turned_rad[side.members] = np.arccos(np.clip(cosine, -1.0, 1.0))
        return across_m, turned_rad

    def sides_at(self, places_m: Array) -> NDArray[np.int64]:
        """The side of each place on the outline, shape (q, 2), shape (q,)."""
        lengths = [len(self.places_m(index, _CHECKED_EVERY_m)) for index in range(len(self.sides))]
        owners = np.repeat(np.arange(len(self.sides)), lengths)
        return np.asarray(owners[np.linalg.norm(places_m[:, None] - self.outline_m, axis=2).argmin(axis=1)])

    def covariance_m2(self, places_m: Array) -> Array:
        """Covariance of displacements along the normals at places on the outline, shapes (q, 2) and (q, q).

        That of the sides: what may be hidden at corners has no part in it.
        """
        owners = self.sides_at(places_m)
        moves = [side.displacements_m(places_m) * (owners == index)[:, None] for index, side in enumerate(self.sides)]
        return np.asarray(self.scatter**2 * sum(each @ each.T for each in moves))

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """The outline; sigma across it from the covariance of the sides and what may be hidden at corners."""
        return Contour(*self.points(resolution_m), is_closed=True)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """Raises ShapeError: an outline has no surface."""
        raise ShapeError("an outline in the plane has no surface")
