"""An outline of straight and round sides that meet in corners or go over into each other."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.cut_corners import CutCorner
from tactile_lab.slam.shape.planar.outlines import is_simple
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, log_evidence, order_along
from tactile_lab.slam.shape.planar.sides import Side, divide_into_sides, price_of_curvature
from tactile_lab.slam.shape.surfaces.sampling import polygon_area
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_REORDERINGS = 2
_SMOOTH_TURN = 0.25
"""Sine of the angle, 14 degrees, below which two sides go over into each other without a corner."""

_NEWTON_STEPS, _SETTLED_m = 12, 1e-6
_SLACK_SIGMAS = 8.0
"""How far a corner may lie behind the outermost contacts of its sides, in standard deviations of a contact."""

_CHECKED_EVERY_m = 0.002


class RoundedOutline:
    """Straight and round sides; a :class:`FittedShape`. Made by :meth:`of`.

    Attributes:
        name: "rounded".
        contacts: all of them.
        sides: in their order along the outline, counter-clockwise.
        joints_m: where each side begins, shape (s, 2).
    """

    name = "rounded"

    def __init__(self, contacts: PlanarContacts, sides: list[Side]) -> None:
        self.contacts, self.sides = contacts, sides
        length_m = np.linalg.norm(np.diff(self._ring_m, axis=0, append=self._ring_m[:1]), axis=1).sum()
        self._contacts_per_m = len(contacts) / max(float(length_m), 1e-9)
        joints = [self._joint(sides[i - 1], sides[i]) for i in range(len(sides))] if len(sides) > 1 else []
        self.joints_m = np.array([place for place, _ in joints]).reshape(-1, 2)
        self._cuts = [cut for _, cut in joints]

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

    @property
    def _ring_m(self) -> Array:
        return np.asarray(self.contacts.points_m[np.concatenate([side.members for side in self.sides])])

    @cached_property
    def log_evidence(self) -> float:
        """Comparable with the log marginal likelihood of a field from the same contacts."""
        chi_square = sum(side.chi_square for side in self.sides)
        given = self.contacts.point_sigma_m, self.contacts.normal_sigma_rad
        bent = sum(side.is_round for side in self.sides) * price_of_curvature(given[1])
        return log_evidence(chi_square, len(self.sides), *given) - 0.5 * bent

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
        lengths = [len(self._places_m(index, _CHECKED_EVERY_m)) for index in range(len(self.sides))]
        owners = np.repeat(np.arange(len(self.sides)), lengths)
        return np.asarray(owners[np.linalg.norm(places_m[:, None] - self.outline_m, axis=2).argmin(axis=1)])

    def covariance_m2(self, places_m: Array) -> Array:
        """Covariance of displacements along the normals at places on the outline, shapes (q, 2) and (q, q).

        That of the sides: what may be hidden at corners has no part in it.
        """
        owners = self.sides_at(places_m)
        moves = [side.displacements_m(places_m) * (owners == index)[:, None] for index, side in enumerate(self.sides)]
        return np.asarray(self._scatter**2 * sum(each @ each.T for each in moves))

    @cached_property
    def _scatter(self) -> float:
        """Root of chi-square per degree of freedom, at least one."""
        freedom = 2 * len(self.contacts) - sum(3 if side.is_round else 2 for side in self.sides)
        return float(np.sqrt(max(1.0, sum(side.chi_square for side in self.sides) / max(freedom, 1))))

    def _joint(self, before: Side, after: Side) -> tuple[Array, CutCorner | None]:
        """Where one side ends and the next begins, and what may be hidden there. Raises ShapeError."""
        ends = np.array(
            [
                before.feet_m(self.contacts.points_m[before.members[-1:]])[0],
                after.feet_m(self.contacts.points_m[after.members[:1]])[0],
            ]
        )
        middle = ends.mean(axis=0)
        turn = _wedge(before.gradients(middle[None])[0], after.gradients(middle[None])[0])
        if abs(turn) < _SMOOTH_TURN:
            return 0.5 * (before.feet_m(middle[None])[0] + after.feet_m(middle[None])[0]), None
        corner = _meeting(before, after, middle)
        leaps = [(corner - ends[0]) @ _along(before, ends[0]), (ends[1] - corner) @ _along(after, ends[1])]
        slack_m = _SLACK_SIGMAS * float(self.contacts.point_sigma_m.max())
        if min(leaps) < -slack_m:
            raise ShapeError("two sides do not meet between their contacts", hint="More contacts there would help")
        beyond = np.array(leaps)[:, None] > 0
        return corner, CutCorner.of(corner, np.where(beyond, ends, corner), self._contacts_per_m)

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """The outline; sigma across it from the covariance of the sides and what may be hidden at corners."""
        points, sigmas = [], []
        for index, side in enumerate(self.sides):
            places_m = self._places_m(index, resolution_m)
            points.append(places_m)
            sigmas.append(np.sqrt(self._scatter**2 * side.variance_m2(places_m) + self._hidden_m2(index, places_m)))
        return Contour(np.vstack(points), np.concatenate(sigmas), is_closed=True)

    def _places_m(self, index: int, resolution_m: float) -> Array:
        """Along a side, from its beginning on, without its end."""
        side = self.sides[index]
        if not len(self.joints_m):
            return _circle_m(side, resolution_m)
        start, end = self.joints_m[index], self.joints_m[(index + 1) % len(self.joints_m)]
        return _arc_m(side, start, end, resolution_m) if side.is_round else _line_m(start, end, resolution_m)

    def _hidden_m2(self, index: int, places_m: Array) -> Array:
        """Mean square distance of places on a side, shape (q, 2), from what may be hidden at its two corners."""
        hidden_m2 = np.zeros(len(places_m))
        for joint in (index, index + 1) if len(self.joints_m) else ():
            at = joint % len(self.joints_m)
            if (cut := self._cuts[at]) is not None:
                away_m = np.linalg.norm(places_m - self.joints_m[at], axis=1)
                hidden_m2 += cut.variance_m2(away_m, after=joint == index)
        return hidden_m2

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """Raises ShapeError: an outline has no surface."""
        raise ShapeError("an outline in the plane has no surface")


def _meeting(before: Side, after: Side, near_m: Array) -> Array:
    """Where two sides cross, near a place. Raises ShapeError."""
    place = near_m.copy()
    for _ in range(_NEWTON_STEPS):
        slopes = np.array([side.gradients(place[None])[0] for side in (before, after)])
        values = np.array([side.values_m(place[None])[0] for side in (before, after)])
        if abs(np.linalg.det(slopes)) < 1e-3:
            break
        step = np.linalg.solve(slopes, values)
        place = place - step
        if np.linalg.norm(step) < _SETTLED_m:
            return np.asarray(place)
    raise ShapeError("two sides do not meet", hint="More contacts near their ends would help")


def _along(side: Side, place_m: Array) -> Array:
    """Unit vector along a side, counter-clockwise."""
    outward = side.gradients(place_m[None])[0]
    return np.asarray(np.array([-outward[1], outward[0]]) / np.linalg.norm(outward))


def _wedge(one: Array, other: Array) -> float:
    return float(one[0] * other[1] - one[1] * other[0])


def _line_m(start: Array, end: Array, resolution_m: float) -> Array:
    steps = max(1, int(np.ceil(np.linalg.norm(end - start) / resolution_m)))
    return np.asarray(start + (np.arange(steps) / steps)[:, None] * (end - start))


def _circle_m(side: Side, resolution_m: float) -> Array:
    if not side.is_round or side.numbers[0] < 0:
        raise ShapeError("one side encloses nothing", hint="Contacts on three sides are needed")
    angles = np.linspace(0.0, 2 * np.pi, max(8, int(np.ceil(2 * np.pi * side.radius_m / resolution_m))), endpoint=False)
    return _at(side, angles, np.full(len(angles), side.radius_m))


def _arc_m(side: Side, start: Array, end: Array, resolution_m: float) -> Array:
    """Along a round side; its ends need not lie exactly on it."""
    arms = np.array([start, end]) - side.centre_m
    first, last = np.arctan2(arms[:, 1], arms[:, 0])
    turn = np.mod(last - first, 2 * np.pi) if side.numbers[0] > 0 else -np.mod(first - last, 2 * np.pi)
    steps = max(1, int(np.ceil(abs(turn) * side.radius_m / resolution_m)))
    share = np.arange(steps) / steps
    lengths = np.linalg.norm(arms, axis=1)
    return _at(side, first + share * turn, lengths[0] + share * (lengths[1] - lengths[0]))


def _at(side: Side, angles_rad: Array, distances_m: Array) -> Array:
    return np.asarray(side.centre_m + distances_m[:, None] * np.column_stack([np.cos(angles_rad), np.sin(angles_rad)]))
