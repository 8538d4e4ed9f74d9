"""Joint uncertainty of poses and flat faces of a trajectory, and derivatives of the faces by the poses.

Right angles and parallels are included: information about one wall holds for all walls related to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.bends import Bends
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother
from tactile_lab.slam.tracking.faces.flat_faces import FlatFaces, flat_faces, tangents
from tactile_lab.slam.tracking.faces.regular_faces import made_regular

_TURN_LIKE_m = 0.05
"""A point belongs to the face that is nearest in position and normal; a radian counts like this many metres."""


@dataclass(frozen=True)
class FacetCertainty:
    """Poses and faces at the solution, linearised.

    Attributes:
        faces: in the object frame.
        information_of_poses: inverse of the joint covariance of all poses but the first, the faces known no better
            than by the contacts, errors that were estimated given, shape (p, p).
        faces_by_poses: derivatives of each face's tilt and offset by those poses, shape (s d, p).
        poses_by_errors: change of those poses by what remains unknown of errors that contacts of one finger share and
            that were estimated, shape (p, m), by independent standard normal variables; m = 0 if none were.
        faces_by_fingers: change of each face's tilt and offset by that, shape (s d, m). If none were estimated, by one
            standard deviation of the error that contacts of one finger share, while the poses adapt, shape
            (s d, fingers).
        faces_by_contacts: the same if each contact had such an error of its own, shape (s d, n).
    """

    faces: FlatFaces
    information_of_poses: Array
    poses_by_errors: Array
    faces_by_poses: Array
    faces_by_fingers: Array
    faces_by_contacts: Array

    @classmethod
    def of(cls, contact_map: ContactMap, noise: MotionNoise, bends: Bends | None = None) -> Self:
        """From poses of largest evidence, contacts in the plane or in space.

        Args:
            contact_map: contacts and poses.
            noise: of the motion model.
            bends: of a round object, whose faces stand in for a smooth surface and have no right angles.

        Raises:
            ShapeError: contacts in the plane whose faces enclose nothing.
        """
        smoother, rows = FacetSmoother(contact_map, noise, bends=bends), contact_map.rows
        faces, _ = flat_faces(contact_map)
        if bends is None:
            faces = made_regular(contact_map, faces, smoother.information(rows, faces))
        information = smoother.information(rows, faces, given_errors=True)
        free = (len(rows) - 1) * contact_map.space.size
        by_poses = -np.linalg.solve(information[free:, free:], information[free:, :free])
        of_poses = information[:free, :free] + information[:free, free:] @ by_poses
        shared = contact_map.contacts_world.shared
        by_errors = smoother.by_shared_errors(rows, faces)
        by_fingers = smoother.response(rows, faces, shared.displacements_m())[free:]
        by_contacts = smoother.response(rows, faces, shared.displacements_each_m())[free:]
        found = by_errors[free:] if by_errors.size else by_fingers
        of_poses = np.asarray((of_poses + of_poses.T) / 2)
        return cls(faces, of_poses, by_errors[:free], np.asarray(by_poses), found, by_contacts)

    def surface_change(self, places_m: Array, normals: Array) -> Array:
        """Derivatives of points on the faces, shape (q, d), along their normals by the poses, shape (q, p)."""
        return np.asarray(self._surface_by_faces(places_m, normals) @ self.faces_by_poses)

    def shared_change(self, places_m: Array, normals: Array) -> Array:
        """Displacement of such points by one standard deviation of each finger's error, shape (q, fingers)."""
        return np.asarray(self._surface_by_faces(places_m, normals) @ self.faces_by_fingers)

    def shared_change_each(self, places_m: Array, normals: Array) -> Array:
        """The same if each contact had such an error of its own, shape (q, n)."""
        return np.asarray(self._surface_by_faces(places_m, normals) @ self.faces_by_contacts)

    def _surface_by_faces(self, places_m: Array, normals: Array) -> Array:
        """Derivatives of points on the faces along their normals by each face's tilt and offset, shape (q, s d)."""
        count, dimension = self.faces.normals.shape
        away_m = np.abs(places_m @ self.faces.normals.T - self.faces.offsets_m)
        turned_rad = np.arccos(np.clip(normals @ self.faces.normals.T, -1.0, 1.0))
        face = (away_m + _TURN_LIKE_m * turned_rad).argmin(axis=1)
        levers = np.einsum("qdt,qd->qt", tangents(self.faces.normals)[face], places_m)
        by_faces = np.zeros((len(places_m), count, dimension))
        by_faces[np.arange(len(places_m)), face] = np.column_stack([-levers, np.ones(len(places_m))])
        return by_faces.reshape(len(places_m), -1)
