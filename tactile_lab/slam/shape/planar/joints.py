"""Joints between successive straight faces of an outline: a corner, or a bridge over an untouched part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.planar.cut_corners import CutCorner
from tactile_lab.slam.shape.planar.segmentation import Faces, PlanarContacts
from tactile_lab.slam.shape.planar.uncertainty import FaceUncertainty
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon
from tactile_lab.slam.shape.surfaces.surface import Contour

Indices = NDArray[np.int64]

_LEAST_TURN = 0.12
"""Sine of the least angle between two faces whose lines are intersected, 7 degrees; flatter ones are bridged."""

_SLACK_SIGMAS = 8.0
"""Largest distance of a corner behind the outermost contacts of its faces, in standard deviations of a contact."""

_MANY = 6
"""On a face with at least this many contacts, one may lie beyond the corner."""

_LARGEST_CORNER_SIGMA_m = 0.015
"""A corner with a larger standard deviation counts as a guess."""

_UNSEEN_CONTACTS = 2.5
_LARGEST_ROUNDING_m = 0.015
"""So does a corner that is farther from the provisional outline than rounding explains, if in addition this many
contacts would be expected beyond the short cut, but there are none: a face in between was missed.
"""

_LONGEST_DETOUR = 4.0
"""A piece of the provisional outline bridges two faces unless it is this many times longer than a straight line."""

_BRIDGE_STEPS = 8

_BRIDGE_SLOPE = 0.5
"""Standard deviation of the direction in which a provisional outline leaves a face: there may be a corner at once."""


@dataclass(frozen=True)
class Joint:
    """The joint from the end of one face to the beginning of the next.

    Attributes:
        points_m: one corner, or a bridge from one end to the other, shape (k, 2).
        sigma_m: standard deviation across the outline at each point of a bridge, shape (k,); NaN at a corner.
        cut: what may be hidden at a corner; None for a bridge.
    """

    points_m: Array
    sigma_m: Array
    cut: CutCorner | None = None


class JointMaker:
    """Makes joints between successive faces.

    Args:
        contacts, faces: as of the polygon.
        provisional: an outline that corners must not stray from, and that bridges the gaps where faces do not meet.
    """

    def __init__(self, contacts: PlanarContacts, faces: Faces, provisional: Contour | None) -> None:
        self._contacts, self._faces, self._provisional = contacts, faces, provisional
        self._uncertainty = FaceUncertainty.of(contacts, faces)
        ring = contacts.points_m[faces.order]
        length = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum()
        self._contacts_per_m = len(contacts) / max(float(length), 1e-9)

    def between(self, face: int, following: int) -> Joint:
        """The joint after ``face``."""
        before, after = self._faces.members(face), self._faces.members(following)
        corner = self._intersection(face, following)
        if corner is not None:
            for last, first in _outermost(before, after):
                ends = self._ends(face, following, int(last), int(first))
                if self._is_plausible(face, following, corner, ends, [last, first]):
                    return Joint(corner[None], np.full(1, np.nan), self._cut(face, following, corner, ends))
        return self._bridge(self._ends(face, following, int(before[-1]), int(after[0])))

    def _ends(self, face: int, following: int, last: int, first: int) -> Array:
        """The last contact of one face and the first of the next."""
        return np.array([self._foot(face, last), self._foot(following, first)])

    def _foot(self, face: int, contact: int) -> Array:
        """A contact moved onto the line of a face."""
        point, normal = self._contacts.points_m[contact], self._faces.normals[face]
        return np.asarray(point - (point @ normal - self._faces.offsets_m[face]) * normal)

    def _intersection(self, face: int, following: int) -> Array | None:
        pair = [face, following]
        normals = self._faces.normals[pair]
        if abs(np.linalg.det(normals)) < _LEAST_TURN:
            return None
        return np.asarray(np.linalg.solve(normals, self._faces.offsets_m[pair]))

    def _leaps_m(self, face: int, following: int, corner: Array, ends: Array) -> Array:
        """How far the corner lies beyond the last contact of one face and before the first of the next, shape (2,)."""
        tangents = self._faces.tangents
        return np.array([(corner - ends[0]) @ tangents[face], (ends[1] - corner) @ tangents[following]])

    def _cut(self, face: int, following: int, corner: Array, ends: Array) -> CutCorner:
        """What may be hidden at a corner, nothing on the side of a face whose contacts reach it."""
        beyond = self._leaps_m(face, following, corner, ends)[:, None] > 0
        return CutCorner.of(corner, np.where(beyond, ends, corner), self._contacts_per_m)

    def _is_plausible(self, face: int, following: int, corner: Array, ends: Array, outermost: list[np.int64]) -> bool:
        """Whether the corner lies between both faces, cuts off no contacts, and is well determined."""
        slack_m = _SLACK_SIGMAS * float(self._contacts.point_sigma_m[outermost].max())
        leaps = self._leaps_m(face, following, corner, ends)
        if leaps.min() < -slack_m:
            return False
        unseen = self._contacts_per_m * (np.abs(leaps).sum() - float(np.linalg.norm(ends[1] - ends[0])))
        if unseen > _UNSEEN_CONTACTS and self._rounding_m(corner) > _LARGEST_ROUNDING_m:
            return False
        variance = max(self._uncertainty.variance_m2(each, corner[None])[0] for each in (face, following))
        return bool(variance < _LARGEST_CORNER_SIGMA_m**2)

    def _rounding_m(self, corner: Array) -> float:
        """Distance of the provisional outline from a corner."""
        return float(distances_to_polygon(corner[None], self._provisional.points_m)[0]) if self._provisional else 0.0

    def _bridge(self, ends: Array) -> Joint:
        """A bridge between two ends: the provisional outline if it goes there, otherwise a straight line.

        Along a straight line sigma grows to a quarter of its length at the middle, since nothing was touched there.
        """
        base = float(self._contacts.point_sigma_m.mean())
        length = float(np.linalg.norm(ends[1] - ends[0]))
        piece = self._piece_of_provisional(ends, _LONGEST_DETOUR * length)
        if piece is not None:
            points_m = np.vstack([ends[:1], piece.points_m, ends[1:]])
            return Joint(points_m, np.hypot([base, *piece.sigma_m, base], _BRIDGE_SLOPE * _to_nearest_end_m(points_m)))
        share = np.linspace(0.0, 1.0, _BRIDGE_STEPS + 1)
        return Joint(ends[0] + share[:, None] * (ends[1] - ends[0]), base + length * share * (1 - share))

    def _piece_of_provisional(self, ends: Array, longest_m: float) -> Contour | None:
        """The provisional outline between the points nearest to the ends, counter-clockwise, without these points."""
        if self._provisional is None:
            return None
        points = self._provisional.points_m
        first, last = (int(np.argmin(np.sum((points - end) ** 2, axis=1))) for end in ends)
        indices = np.arange(first, last + len(points) * (last < first) + 1)[2:-2] % len(points)
        length = np.linalg.norm(np.diff(points[indices], axis=0), axis=1).sum()
        if len(indices) == 0 or length > longest_m:
            return None
        return Contour(points[indices], self._provisional.sigma_m[indices], is_closed=False)


def _to_nearest_end_m(line_m: Array) -> Array:
    """The way along a line from each point to the nearer end, shape (k,)."""
    way_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1)))
    return np.asarray(np.minimum(way_m, way_m[-1] - way_m))


def _outermost(before: Indices, after: Indices) -> list[tuple[np.int64, np.int64]]:
    """The last contact of a face and the first of the next; on a face with many contacts, this one may be ignored.

    The position of grasps that touch only parallel faces is undetermined along them, so that a contact may end up
    beyond the corner.
    """
    pairs = [(before[-1], after[0])]
    pairs += [(before[-2], after[0])] if len(before) >= _MANY else []
    pairs += [(before[-1], after[1])] if len(after) >= _MANY else []
    return pairs
