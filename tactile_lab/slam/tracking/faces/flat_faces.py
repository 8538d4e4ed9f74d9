"""The flat faces that the contacts of a map lie on, in the plane and in space alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.shape.regularities import Regularity
from tactile_lab.slam.shape.selection.planar_choice import outline_of
from tactile_lab.slam.shape.solids.planes import segment_planes
from tactile_lab.slam.shape.surfaces.surface import extract_contour
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.faces.face_extents import between_ends

_ORDERING_RESOLUTION_m = 0.002
"""Of the outline that only orders contacts along it."""


@dataclass(frozen=True)
class FlatFaces:
    """Faces ``u . x = offset`` in the object frame and the contacts on them.

    Attributes:
        labels: face of each contact, shape (n,).
        normals: outward unit normals u, shape (s, d).
        offsets_m: shape (s,).
        leaning: contacts at corners, on their face but with a normal that is not the face's, shape (n,).
        bounded: contacts that cannot lie beyond the ends of their face, shape (n,).
        regularities: of the faces, which they keep.
    """

    labels: NDArray[np.int64]
    normals: Array
    offsets_m: Array
    leaning: NDArray[np.bool_]
    bounded: NDArray[np.bool_]
    regularities: tuple[Regularity, ...] = ()

    @property
    def count(self) -> int:
        return len(self.offsets_m)

    def merge(self, kept: int, dropped: int) -> FlatFaces:
        """The same with two faces merged, averaged by their numbers of contacts; without regularities."""
        weights = np.bincount(self.labels, minlength=self.count)[[kept, dropped]].astype(float)
        weights /= weights.sum()
        normals, offsets = self.normals.copy(), self.offsets_m.copy()
        between = weights @ normals[[kept, dropped]]
        normals[kept], offsets[kept] = between / np.linalg.norm(between), weights @ offsets[[kept, dropped]]
        labels = np.where(self.labels == dropped, kept, self.labels)
        labels = labels - (labels > dropped)
        normals, offsets = np.delete(normals, dropped, axis=0), np.delete(offsets, dropped)
        return FlatFaces(labels, normals, offsets, self.leaning, self.bounded)

    def irregularity(self) -> Array:
        """Deviation of the faces from their regularities, radians, shape (r,)."""
        return np.concatenate([np.empty(0), *(each.state(self.normals).gap for each in self.regularities)])

    def irregularity_by_faces(self) -> Array:
        """Its derivatives by each face's tilt and offset, shape (r, s, d)."""
        count, dimension = self.normals.shape
        if not self.regularities:
            return np.empty((0, count, dimension))
        rows = np.concatenate([each.state(self.normals).rows for each in self.regularities])
        rows = rows.reshape(-1, count, dimension)
        by_tilts = np.einsum("rsd,sdt->rst", rows, tangents(self.normals))
        return np.concatenate([by_tilts, np.zeros((len(rows), count, 1))], axis=2)


Neighbours = Callable[[FlatFaces], list[tuple[int, int]]]


def flat_faces(contact_map: ContactMap) -> tuple[FlatFaces, Neighbours]:
    """The faces of a map's contacts, and which of them may be merged.

    Raises:
        ShapeError: contacts in the plane whose faces enclose nothing.
    """
    return _outline_faces(contact_map) if contact_map.dimension == 2 else _solid_faces(contact_map)


def _outline_faces(contact_map: ContactMap) -> tuple[FlatFaces, Neighbours]:
    """The faces of an outline; only successive ones may be merged. Raises ShapeError."""
    fitted, seen = contact_map.fit(), contact_map.contacts
    polygon, leaning = outline_of(fitted, extract_contour(fitted, resolution_m=_ORDERING_RESOLUTION_m))
    found, order = polygon.faces, np.flatnonzero(~leaning)[polygon.faces.order]
    away = np.abs(seen.points_m @ found.normals.T - found.offsets_m)
    labels = np.where(seen.normals @ found.normals.T > 0, away, np.inf).argmin(axis=1)
    labels[~leaning] = found.labels

    def in_turn(faces: FlatFaces) -> list[tuple[int, int]]:
        along = faces.labels[order]
        borders = np.flatnonzero(along != np.roll(along, 1))
        pairs = np.sort(np.column_stack([along[borders - 1], along[borders]]), axis=1)
        return [(int(one), int(other)) for one, other in np.unique(pairs, axis=0)]

    bounded = between_ends(seen.points_m, labels, found.normals, found.offsets_m, seen.sideways_sigma_m)
    bounded &= "face extents" not in contact_map.settings.without
    return FlatFaces(labels, found.normals, found.offsets_m, leaning, bounded), in_turn


def _solid_faces(contact_map: ContactMap) -> tuple[FlatFaces, Neighbours]:
    """The planes of a solid; any two may be merged."""
    seen = contact_map.contacts
    planes = segment_planes(seen.points_m, seen.normals, seen.point_sigma_m, seen.normal_sigma_rad)

    def all_pairs(faces: FlatFaces) -> list[tuple[int, int]]:
        return [(one, other) for other in range(faces.count) for one in range(other)]

    none = np.zeros(len(seen), dtype=bool)
    return FlatFaces(planes.labels, planes.normals, planes.offsets_m, none, none), all_pairs


def tangents(normals: Array) -> Array:
    """Orthonormal directions along each face, by which it tilts, shape (s, d, d - 1)."""
    if normals.shape[1] == 2:
        return np.stack([-normals[:, 1], normals[:, 0]], axis=1)[:, :, None]
    helper = np.where(np.abs(normals[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first)], axis=2)
