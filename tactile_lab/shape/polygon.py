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
    def face_covariances(self) -> Array:
        """Covariance of (direction rad, offset m) of each face, shape (s, 2, 2), the scatter found included."""
        spread = _scatter(self.contacts, self.faces) ** 2
        return spread * np.array([face_covariance(self.contacts, self.faces, s) for s in range(self.faces.count)])

    @property
    def corner_covariances_m2(self) -> Array:
        """Covariance of every corner, shape (k, 2, 2), square metres.

        The ends of a joining line are known across their face; along it they are contacts, no corners.
        """
        before = np.roll(self.edge_faces, 1)
        return np.array(
            [
                self._corner_covariance(corner, (int(a), int(b)))
                for corner, a, b in zip(self.corners_m, before, self.edge_faces, strict=True)
            ]
        )

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
            sigmas.append(self._sigma(places, face) if face >= 0 else length * share * (1 - share) + self._end_sigma)
        return Contour(np.vstack(points), np.concatenate(sigmas), is_closed=True)

    def mesh(self, resolution_m: float = 0.003, floor_m: float | None = None) -> SurfaceMesh:
        """An outline has no surface. Raises ShapeError."""
        raise ShapeError("a polygon is an outline in the plane and has no surface")

    @property
    def _end_sigma(self) -> float:
        return float(self.contacts.point_sigma_m.mean())

    def _sigma(self, places_m: Array, face: int) -> Array:
        """Standard deviation of places on a face, across it."""
        effects = np.column_stack([-places_m @ self.faces.tangents[face], np.ones(len(places_m))])
        return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", effects, self.face_covariances[face], effects)))

    def _corner_covariance(self, corner_m: Array, faces: tuple[int, int]) -> Array:
        known = [face for face in faces if face >= 0]
        if len(known) == 2:
            across = np.linalg.inv(self.faces.normals[known])
        else:
            across = np.linalg.inv(np.array([self.faces.normals[known[0]], self.faces.tangents[known[0]]]))
        sigmas = np.array([self._sigma(corner_m[None], face)[0] for face in known] + [self._end_sigma])[:2]
        return np.asarray((across * sigmas**2) @ across.T)


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
    sigmas = [_across_sigma(contacts, faces, face, corner) for face in pair]
    return bool(max(sigmas) < _LARGEST_CORNER_SIGMA_m)


def _across_sigma(contacts: PlanarContacts, faces: Faces, face: int, place_m: Array) -> float:
    effect = np.array([-place_m @ faces.tangents[face], 1.0])
    return float(np.sqrt(effect @ face_covariance(contacts, faces, face) @ effect))


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


def face_covariance(contacts: PlanarContacts, faces: Faces, face: int) -> Array:
    """Covariance of (direction rad, offset m) of one face from the standard deviations of its contacts, (2, 2)."""
    members = faces.members(face)
    effects = np.column_stack([-contacts.points_m[members] @ faces.tangents[face], np.ones(len(members))])
    information = (effects / contacts.point_sigma_m[members, None] ** 2).T @ effects
    information[0, 0] += np.sum(contacts.normal_sigma_rad[members] ** -2.0)
    return np.asarray(np.linalg.inv(information))


def _scatter(contacts: PlanarContacts, faces: Faces) -> float:
    """Root of chi-square per degree of freedom, if above one: the contacts scatter more than they claim to."""
    freedom = 2 * len(contacts) - 2 * faces.count
    return float(np.sqrt(max(1.0, faces.chi_square / freedom))) if freedom > 0 else 1.0
