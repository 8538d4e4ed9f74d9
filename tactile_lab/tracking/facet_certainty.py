"""How well flat faces tie the poses of a trajectory together, and how faces follow poses that are off.

Right angles and parallels count: what holds one wall holds all walls tied to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.polyhedron_planes import Planes, weighted_contacts
from tactile_lab.shape.polyhedron_regularity import regularise
from tactile_lab.tracking.contact_map import ContactMap
from tactile_lab.tracking.facet_smoothing import FacetSmoother
from tactile_lab.tracking.flat_faces import FlatFaces, flat_faces, tangents
from tactile_lab.tracking.motion import MotionNoise
from tactile_lab.tracking.pose_rows import PLANAR

_EXACTLY_rad = 1e-4
"""Normals this close to parallel or to a right angle were made so by a regularity."""

_TIED_SIGMA_rad = 1e-4
"""Faces that share a regularity turn against each other by no more: far less than contacts can tell."""

_TURN_LIKE_m = 0.05
"""A place belongs to the face that is near and faces its way; a radian counts like so many metres."""


@dataclass(frozen=True)
class FacetCertainty:
    """Poses and faces at the solution, linearised.

    Attributes:
        faces: in the object frame.
        information_of_poses: inverse of the joint covariance of all poses but the first, the faces known no better
            than contacts tell, shape (p, p).
        faces_by_poses: derivatives of each face's tilt and offset by those poses, shape (s d, p).
    """

    faces: FlatFaces
    information_of_poses: Array
    faces_by_poses: Array

    @classmethod
    def of(cls, contact_map: ContactMap, noise: MotionNoise) -> Self:
        """From poses of largest evidence, contacts in the plane or in space.

        Raises:
            ShapeError: contacts in the plane whose faces enclose nothing.
        """
        faces, _ = flat_faces(contact_map)
        information = FacetSmoother(contact_map, noise).information(contact_map.rows, faces)
        free = (len(contact_map.placed) - 1) * contact_map.space.size
        on_table = contact_map.space is PLANAR
        ties = _ties(_regular_normals(contact_map, faces), on_table=on_table) / _TIED_SIGMA_rad
        by_poses = -np.linalg.solve(information[free:, free:] + ties.T @ ties, information[free:, :free])
        of_poses = information[:free, :free] + information[:free, free:] @ by_poses
        return cls(faces, np.asarray((of_poses + of_poses.T) / 2), np.asarray(by_poses))

    def surface_change(self, places_m: Array, normals: Array) -> Array:
        """How places on the faces, shape (q, d), move along their normals with the poses, shape (q, p)."""
        count, dimension = self.faces.normals.shape
        away_m = np.abs(places_m @ self.faces.normals.T - self.faces.offsets_m)
        turned_rad = np.arccos(np.clip(normals @ self.faces.normals.T, -1.0, 1.0))
        face = (away_m + _TURN_LIKE_m * turned_rad).argmin(axis=1)
        levers = np.einsum("qdt,qd->qt", tangents(self.faces.normals)[face], places_m)
        by_faces = np.zeros((len(places_m), count, dimension))
        by_faces[np.arange(len(places_m)), face] = np.column_stack([-levers, np.ones(len(places_m))])
        return np.asarray(by_faces.reshape(len(places_m), -1) @ self.faces_by_poses)


def _regular_normals(contact_map: ContactMap, faces: FlatFaces) -> Array:
    """Normals turned to be as regular as the contacts allow, shape (s, d); in the plane they are already."""
    if contact_map.dimension == 2:
        return faces.normals
    seen = contact_map.contacts
    weighted = weighted_contacts(seen.points_m, seen.normals, seen.point_sigma_m, seen.normal_sigma_rad)
    planes = Planes(faces.labels, faces.normals, faces.offsets_m, 0.0)
    return regularise(weighted, planes, upright=contact_map.space is PLANAR).planes.normals


def _ties(normals: Array, *, on_table: bool) -> Array:
    """Combinations of all faces' tilts and offsets that regularities make vanish, shape (t, s d).

    Faces on a table are also tied to the vertical, which does not turn, if they are level or upright.
    """
    count, dimension = normals.shape
    turned = tangents(normals)
    rows = [np.zeros((0, count, dimension))]
    for one in range(count):
        for other in range(one):
            for by_one, by_other in _watched(normals[one], normals[other], turned[one]):
                row = np.zeros((1, count, dimension))
                row[0, one, :-1], row[0, other, :-1] = turned[one].T @ by_one, turned[other].T @ by_other
                rows.append(row)
        vertical = np.array([0.0, 0.0, 1.0]) if on_table and dimension == 3 else np.zeros(dimension)
        for by_one, _ in _watched(normals[one], vertical, turned[one]) if vertical.any() else []:
            row = np.zeros((1, count, dimension))
            row[0, one, :-1] = turned[one].T @ by_one
            rows.append(row)
    return np.concatenate(rows).reshape(-1, count * dimension)


def _watched(normal: Array, other: Array, along: Array) -> list[tuple[Array, Array]]:
    """What must not change when two directions turn, as derivatives by each of them; nothing for any other angle.

    At right angles their product; if parallel, what one has along the other's face.
    """
    cosine = float(normal @ other)
    if abs(cosine) < _EXACTLY_rad:
        return [(other, normal)]
    if np.linalg.norm(normal - np.sign(cosine) * other) < _EXACTLY_rad:
        return [(axis, -np.sign(cosine) * axis) for axis in along.T]
    return []
