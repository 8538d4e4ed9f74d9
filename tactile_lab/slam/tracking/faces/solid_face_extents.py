"""Extents of the faces of a solid: where neighbouring faces meet in a ridge or a notch.

In the plane the corners follow from the order of the faces (:mod:`face_extents`); in space they follow from the body
that the planes enclose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.faces.face_extents import FARTHEST_SIGMAS, LEAST_TURN
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class SolidFaceExtents:
    """Contacts that must not lie beyond a neighbouring face, one entry each.

    Attributes:
        contacts: shape (k,).
        faces: that the contact's own face ends at, shape (k,).
        strengths: by which distances from those faces count, 1/m, shape (k,): over the noise and the sine between the
            two faces, positive at a ridge and negative in a notch.
    """

    contacts: Indices
    faces: Indices
    strengths: Array

    def beyond(self, points_m: Array, normals: Array, offsets_m: Array) -> Array:
        """How far the contacts lie beyond the ends, in standard deviations, shape (k,); negative before them.

        Args:
            points_m: all contacts, object frame, shape (n, 3).
            normals, offsets_m: of all faces, shape (s, 3) and (s,).
        """
        over_m = np.einsum("kd,kd->k", points_m[self.contacts], normals[self.faces]) - offsets_m[self.faces]
        return np.asarray(self.strengths * over_m)


def solid_face_extents(contact_map: ContactMap, faces: FlatFaces) -> SolidFaceExtents:
    """The ends of the faces that a map's contacts lie on, for contacts that do not lie beyond them already.

    Args:
        contact_map: in space.
        faces: of its contacts.

    Raises:
        ShapeError: the planes of the contacts enclose nothing.
    """
    if "face extents" in contact_map.settings.without:
        return SolidFaceExtents(np.empty(0, int), np.empty(0, int), np.empty(0))
    seen, upright = contact_map.contacts, contact_map.space is PLANAR
    planes, borders = Polyhedron.fit(contact_map.fit(), contact_map.free_points_m, upright=upright).ends()
    lines = [
        _bounding_contacts(faces, *_faces_of(faces, planes, border), border[2], seen.point_sigma_m)
        for border in borders
    ]
    joined = [np.concatenate(column) for column in zip(*lines, strict=True)] if lines else [np.empty(0, int)] * 3
    ends = SolidFaceExtents(joined[0], joined[1], np.asarray(joined[2], dtype=float))
    inside = ends.beyond(seen.points_m, faces.normals, faces.offsets_m) < FARTHEST_SIGMAS
    return SolidFaceExtents(ends.contacts[inside], ends.faces[inside], ends.strengths[inside])


def _faces_of(faces: FlatFaces, planes: Indices, border: Indices) -> tuple[int, int]:
    """The faces that most contacts of a border's two planes lie on."""
    one, other = (int(np.bincount(faces.labels[planes == plane]).argmax()) for plane in border[:2])
    return one, other


def _bounding_contacts(
    faces: FlatFaces, face: int, end: int, way: int, sigma_m: Array
) -> tuple[Indices, Indices, Array]:
    """The contacts of a face that ends at another, that face, and how strongly it counts."""
    turn = float(np.sqrt(max(1 - (faces.normals[face] @ faces.normals[end]) ** 2, 0.0)))
    contacts = np.flatnonzero(faces.labels == face) if turn > LEAST_TURN else np.empty(0, dtype=np.int64)
    return contacts, np.full(len(contacts), end), way / (max(turn, LEAST_TURN) * sigma_m[contacts])
