"""Straight and round sides one after the other, and the joints between them: corners, or where one goes over into the
next.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.planar.cut_corners import CutCorner
from tactile_lab.slam.shape.planar.segmentation import PlanarContacts, log_evidence
from tactile_lab.slam.shape.planar.sides import Side, price_of_curvature

_SMOOTH_TURN = 0.25
"""Sine of the angle, 14 degrees, below which two sides go over into each other without a corner."""

_NEWTON_STEPS, _SETTLED_m = 12, 1e-6
_SLACK_SIGMAS = 8.0
"""How far a corner may lie behind the outermost contacts of its sides, in standard deviations of a contact."""


class Joint(NamedTuple):
    """Where a side begins or ends.

    Attributes:
        place_m: shape (2,).
        cut: what may be hidden there; None where nothing is.
    """

    place_m: Array
    cut: CutCorner | None = None


class SidedLine:
    """Sides in their order along a line, the object on its left.

    Args:
        contacts: all of them.
        sides: in their order.
        joints: where each side begins; of a line that is not closed also where the last one ends.
        beside: sides of the other contacts, which the line does not lead along.

    Attributes:
        contacts, sides: as given.
        joints_m: shape (j, 2).
    """

    def __init__(
        self, contacts: PlanarContacts, sides: list[Side], joints: list[Joint], beside: Sequence[Side] = ()
    ) -> None:
        self.contacts, self.sides, self._all = contacts, sides, [*sides, *beside]
        self.joints_m = np.array([joint.place_m for joint in joints]).reshape(-1, 2)
        self._cuts = [joint.cut for joint in joints]

    @cached_property
    def log_evidence(self) -> float:
        """Comparable with the log marginal likelihood of a field from the same contacts."""
        given = self.contacts.point_sigma_m, self.contacts.normal_sigma_rad
        bent = sum(side.is_round for side in self._all) * price_of_curvature(given[1])
        return log_evidence(self._chi_square, len(self._all), *given) - 0.5 * bent

    @property
    def _chi_square(self) -> float:
        return sum(side.chi_square for side in self._all)

    @cached_property
    def scatter(self) -> float:
        """Root of chi-square per degree of freedom, at least one."""
        freedom = 2 * len(self.contacts) - sum(3 if side.is_round else 2 for side in self._all)
        return float(np.sqrt(max(1.0, self._chi_square / max(freedom, 1))))

    def points(self, resolution_m: float) -> tuple[Array, Array]:
        """Along all sides, shape (n, 2), and sigma across them, shape (n,), from the covariance of the sides and what
        may be hidden at corners; without the end of a line that is not closed.
        """
        points, sigmas = [], []
        for index, side in enumerate(self.sides):
            places_m = self.places_m(index, resolution_m)
            points.append(places_m)
            sigmas.append(np.sqrt(self.scatter**2 * side.variance_m2(places_m) + self._hidden_m2(index, places_m)))
        return np.vstack(points), np.concatenate(sigmas)

    def places_m(self, index: int, resolution_m: float) -> Array:
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


def joint_between(before: Side, after: Side, contacts: PlanarContacts, per_m: float) -> Joint:
    """Where one side ends and the next begins, and what may be hidden there.

    Args:
        before, after: successive sides.
        contacts: that their members are numbers of.
        per_m: contacts for each metre.

    Raises:
        ShapeError: the sides do not meet between their contacts.
    """
    ends = np.array(
        [
            before.feet_m(contacts.points_m[before.members[-1:]])[0],
            after.feet_m(contacts.points_m[after.members[:1]])[0],
        ]
    )
    middle = ends.mean(axis=0)
    turn = _wedge(before.gradients(middle[None])[0], after.gradients(middle[None])[0])
    if abs(turn) < _SMOOTH_TURN:
        return Joint(0.5 * (before.feet_m(middle[None])[0] + after.feet_m(middle[None])[0]))
    corner = _meeting(before, after, middle)
    leaps = [(corner - ends[0]) @ _along(before, ends[0]), (ends[1] - corner) @ _along(after, ends[1])]
    slack_m = _SLACK_SIGMAS * float(contacts.point_sigma_m.max())
    if min(leaps) < -slack_m:
        raise ShapeError("two sides do not meet between their contacts", hint="More contacts there would help")
    beyond = np.array(leaps)[:, None] > 0
    return Joint(corner, CutCorner.of(corner, np.where(beyond, ends, corner), per_m))


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
