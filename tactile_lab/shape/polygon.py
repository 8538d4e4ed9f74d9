"""The facet model in the plane: an outline of straight faces that meet in sharp corners."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from tactile_lab.errors import ShapeError
from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.outlines import is_simple
from tactile_lab.shape.polygon_segmentation import Faces, PlanarContacts, log_evidence
from tactile_lab.shape.polygon_uncertainty import FaceUncertainty
from tactile_lab.shape.sampling import polygon_area
from tactile_lab.shape.surface import Contour, SurfaceMesh

LEAST_FACES = 3

_LEAST_TURN = 0.12
"""Sine of the least angle between two faces whose lines are intersected, 7 degrees; flatter ones are joined."""

_SLACK_SIGMAS = 5.0
"""A corner may lie so many standard deviations of a contact behind the outermost contacts of its faces."""

_LARGEST_LEAP_m = 0.060
"""A corner farther than this from the outermost contact of one of its faces is a guess."""

_LARGEST_CORNER_SIGMA_m = 0.015
"""So is one that is known worse than this."""


class Polygon:
    """An outline of straight faces; a :class:`FittedShape`. Made by :meth:`of`.

    Attributes:
        name: "polygon".
        contacts: what it was made from.
        faces: which contact lies on which face.
        corners_m: corners of the outline, counter-clockwise, shape (k, 2); more than faces where two neighbouring
            faces do not meet in a plausible corner and are joined by a straight line between their outermost contacts.
        edge_faces: face of the edge from each corner to the next, -1 for such a joining line, shape (k,).
    """

    name = "polygon"

    def __init__(self, contacts: PlanarContacts, faces: Faces, corners_m: Array, edge_faces: tuple[int, ...]) -> None:
        self.contacts, self.faces, self.corners_m, self.edge_faces = contacts, faces, corners_m, edge_faces

    @classmethod
    def of(cls, contacts: PlanarContacts, faces: Faces) -> Self:
        """The outline of faces, each met by its neighbours.

        Raises:
            ShapeError: fewer than three faces, or faces that do not enclose one simple region: no polygon then.
        """
        if faces.count < LEAST_FACES:
            raise ShapeError(f"{faces.count} faces enclose nothing", hint="Contacts on three sides are needed")
        joints = [_joint(contacts, faces, face) for face in range(faces.count)]
        corners = np.vstack([joint.points_m for joint in joints])
        edge_faces = [face for before, joint in enumerate(joints) for face in joint.edges_from(before, faces.count)]
        if polygon_area(corners) <= 0 or not is_simple(corners):
            raise ShapeError("the faces do not enclose one region", hint="More contacts near the corners would help")
        return cls(contacts, faces, corners, tuple(edge_faces))

    @cached_property
    def log_evidence(self) -> float:
        """Comparable with the log marginal likelihood of a field from the same contacts; see :func:`log_evidence`."""
        contacts = self.contacts
        return log_evidence(self.faces.chi_square, self.faces.count, contacts.point_sigma_m, contacts.normal_sigma_rad)

    @cached_property
    def uncertainty(self) -> FaceUncertainty:
        """Of the faces, the scatter found included."""
        return FaceUncertainty.of(self.contacts, self.faces).scaled(_scatter(self.contacts, self.faces))

    @property
    def corner_covariances_m2(self) -> Array:
        """Covariance of every corner, shape (k, 2, 2), square metres.

        The ends of a joining line are known across their face; along it they are contacts, no corners.
        """
        pairs = zip(self.corners_m, np.roll(self.edge_faces, 1), self.edge_faces, strict=True)
        return np.array([self._corner_covariance(corner, int(before), after) for corner, before, after in pairs])

    def contour(self, resolution_m: float = 0.001) -> Contour:
        """The outline with every corner; sigma across it from the covariance of the faces.

        Along a joining line sigma grows towards the middle, to a quarter of its length: nothing was touched there.
        """
        points, sigmas = [], []
        for start, end, face in zip(self.corners_m, np.roll(self.corners_m, -1, axis=0), self.edge_faces, strict=True):
            length = float(np.linalg.norm(end - start))
            share = np.arange(max(1, int(np.ceil(length / resolution_m)))) / max(1, np.ceil(length / resolution_m))
            places = start + share[:, None] * (end - start)
            points.append(places)
            sigmas.append(self._sigma_m(places, face, share * length, (1 - share) * length))
        return Contour(np.vstack(points), np.concatenate(sigmas), is_closed=True)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """An outline has no surface. Raises ShapeError."""
        raise ShapeError("a polygon is an outline in the plane and has no surface")

    @property
    def _end_sigma_m(self) -> float:
        return float(self.contacts.point_sigma_m.mean())

    def _sigma_m(self, places_m: Array, face: int, behind_m: Array, ahead_m: Array) -> Array:
        """Standard deviations of places on one edge, so far from its two corners."""
        if face >= 0:
            return np.asarray(np.sqrt(self.uncertainty.variance_m2(face, places_m)))
        return self._end_sigma_m + behind_m * ahead_m / (behind_m + ahead_m)

    def _corner_covariance(self, corner_m: Array, before: int, after: int) -> Array:
        if before >= 0 and after >= 0:
            across = np.linalg.inv(self.faces.normals[[before, after]])
            return np.asarray(across @ self.uncertainty.joint_variance_m2(before, after, corner_m) @ across.T)
        face = max(before, after)
        axes = np.array([self.faces.normals[face], self.faces.tangents[face]])
        variances = [self.uncertainty.variance_m2(face, corner_m[None])[0], self._end_sigma_m**2]
        return np.asarray((axes.T * variances) @ axes)


@dataclass(frozen=True)
class _Joint:
    """Where a face passes into the next: one corner, or the two ends of a joining line."""

    points_m: Array

    def edges_from(self, face: int, count: int) -> list[int]:
        """Faces of the edges that begin at these points, the first being the end of ``face``."""
        following = (face + 1) % count
        return [following] if len(self.points_m) == 1 else [-1, following]


def _joint(contacts: PlanarContacts, faces: Faces, face: int) -> _Joint:
    following = (face + 1) % faces.count
    last, first = faces.members(face)[-1], faces.members(following)[0]
    ends = np.array([_foot(contacts, faces, face, last), _foot(contacts, faces, following, first)])
    corner = _intersection(faces, face, following)
    slack = _SLACK_SIGMAS * max(contacts.point_sigma_m[last], contacts.point_sigma_m[first])
    if corner is not None and _is_plausible(contacts, faces, (face, following), corner, ends, slack):
        return _Joint(corner[None])
    return _Joint(ends)


def _is_plausible(
    contacts: PlanarContacts, faces: Faces, pair: tuple[int, int], corner: Array, ends: Array, slack_m: float
) -> bool:
    """The corner lies ahead of the one face and before the other, not too far, and is known well enough."""
    leaps = np.array([(corner - ends[0]) @ faces.tangents[pair[0]], (ends[1] - corner) @ faces.tangents[pair[1]]])
    if leaps.min() < -slack_m or leaps.max() > _LARGEST_LEAP_m:
        return False
    uncertainty = FaceUncertainty.of(contacts, faces)
    return bool(max(uncertainty.variance_m2(face, corner[None])[0] for face in pair) < _LARGEST_CORNER_SIGMA_m**2)


def _intersection(faces: Faces, face: int, following: int) -> Array | None:
    pair = [face, following]
    normals = faces.normals[pair]
    if abs(np.linalg.det(normals)) < _LEAST_TURN:
        return None
    return np.asarray(np.linalg.solve(normals, faces.offsets_m[pair]))


def _foot(contacts: PlanarContacts, faces: Faces, face: int, contact: int) -> Array:
    """A contact moved onto the line of a face."""
    point, normal = contacts.points_m[contact], faces.normals[face]
    return np.asarray(point - (point @ normal - faces.offsets_m[face]) * normal)


def _scatter(contacts: PlanarContacts, faces: Faces) -> float:
    """Root of chi-square per degree of freedom, if above one: the contacts scatter more than they claim to."""
    freedom = 2 * len(contacts) - 2 * faces.count
    return float(np.sqrt(max(1.0, faces.chi_square / freedom))) if freedom > 0 else 1.0
