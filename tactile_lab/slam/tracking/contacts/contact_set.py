"""Contacts as arrays in the dimension that is tracked, checked once at the border."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import LARGEST_SLOPE, ApproachPath, Array, Contact, FARTHEST_m, Grasp, LARGEST_GRASP_m
from drivers.core.errors import TrackingError
from tactile_lab.slam.tracking.contacts.free_space import fingertip_places, places_on_line
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR, PoseVectors
from tactile_lab.slam.tracking.contacts.shared_errors import NO_SHARED_ERRORS, SharedErrors

_LEAST_OWN_SHARE = 0.01
"""Of a contact's variance that is drawn anew: one that has nothing but its finger's errors would weigh without end."""

LEAST_SIGMA_m, LEAST_SIGMA_rad = 1e-6, 1e-5
"""No contact is known better, whatever its covariance says: one that is known exactly has no finite weight."""


@dataclass(frozen=True)
class ContactSet:
    """Contacts of one or several grasps in one frame.

    Attributes:
        points_m: shape (n, d), d = 2 for a contour in the table plane, 3 for a surface.
        normals: outward unit normals, shape (n, d).
        point_sigma_m: standard deviation of each point along its normal, shape (n,).
        normal_sigma_rad: standard deviation of each normal's direction, shape (n,).
        free_m: places known to be outside of the object when these contacts were made, shape (q, d), same frame.
        free_of: the contact whose finger was at each of them, -1 for a finger without contact, shape (q,).
        shared: errors that contacts of one finger share.
        probed: which were made by fingers that touched before the hand closed, so that nothing had pushed the object,
            shape (n,); empty where that is not known.
    """

    points_m: Array
    normals: Array
    point_sigma_m: Array
    normal_sigma_rad: Array
    free_m: Array = field(default_factory=lambda: np.empty((0, 0)))
    free_of: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    shared: SharedErrors = NO_SHARED_ERRORS
    probed: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))

    def __len__(self) -> int:
        return len(self.points_m)

    @property
    def dimension(self) -> int:
        return int(self.points_m.shape[1])

    @property
    def by_touch(self) -> bool:
        """Whether there are contacts, and the hand did not close for any."""
        return len(self.probed) > 0 and bool(self.probed.all())

    @cached_property
    def free_ahead_m(self) -> Array:
        """Distance of each free place from its finger's contact, 0 where there was none, shape (q,)."""
        ahead_m, touching = np.zeros(len(self.free_m)), np.flatnonzero(self.free_of >= 0)
        if len(touching):
            steps_m = self.free_m[touching] - self.points_m[self.free_of[touching]]
            ahead_m[touching] = np.linalg.norm(steps_m, axis=1)
        return ahead_m

    @property
    def sideways_sigma_m(self) -> Array:
        """Standard deviation of each point along its face, shape (n,): errors are taken out along the normal only."""
        if not self.shared.are_taken_out:
            return self.point_sigma_m
        return np.asarray(np.sqrt(self.point_sigma_m**2 + np.sum(self.shared.moves_m**2, axis=1)))

    @classmethod
    def of_grasp(cls, grasp: Grasp, dimension: int, origin_height_m: float) -> Self:
        """The contacts of a grasp, heights counted from the object origin's.

        In two dimensions points and normals are projected onto the table plane, and contacts on slopes too flat to be
        informative about the contour are left out.

        Raises:
            TrackingError: NaN or infinite entries, normals without length, contacts metres apart.
        """
        points, normals = grasp.points_world_m, grasp.normals_world
        covariances = np.array([contact.point_covariance_m2 for contact in grasp.contacts]).reshape(-1, 3, 3)
        normal_sigma = np.array([contact.normal_sigma_rad for contact in grasp.contacts])
        _check(grasp, points, normals, covariances, normal_sigma)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        counted = list(grasp.contacts)
        if dimension == 2:
            flat = np.linalg.norm(normals[:, :2], axis=1)
            keep = flat > LARGEST_SLOPE
            points, covariances, flat = points[keep], covariances[keep], flat[keep]
            normals = np.column_stack([normals[keep, :2] / flat[:, None], np.zeros(len(flat))])
            normal_sigma, counted = normal_sigma[keep] / flat, [counted[index] for index in np.flatnonzero(keep)]
        along_normal = np.sqrt(np.einsum("ni,nij,nj->n", normals, covariances, normals))
        heights = np.array([0.0, 0.0, origin_height_m])
        along_normal = np.maximum(along_normal, LEAST_SIGMA_m)
        normal_sigma = np.maximum(normal_sigma, LEAST_SIGMA_rad)
        seen = cls((points - heights)[:, :dimension], normals[:, :dimension].copy(), along_normal, normal_sigma)
        free, free_of = _free_places(grasp, seen, counted, heights)
        probed = np.array([contact.probed for contact in counted], dtype=bool)
        return replace(seen, free_m=free, free_of=free_of, shared=SharedErrors.of(counted, normals), probed=probed)

    @classmethod
    def concatenate(cls, parts: Sequence[ContactSet]) -> Self:
        """All contacts of the parts in order."""
        return cls(
            np.concatenate([part.points_m for part in parts]),
            np.concatenate([part.normals for part in parts]),
            np.concatenate([part.point_sigma_m for part in parts]),
            np.concatenate([part.normal_sigma_rad for part in parts]),
            shared=SharedErrors.concatenate([part.shared.of_count(len(part)) for part in parts]),
        )

    def without_free_places(self) -> ContactSet:
        """The contacts alone."""
        return replace(self, free_m=np.empty((0, self.dimension)), free_of=np.empty(0, dtype=np.intp))

    def in_object_frame(self, world_T_object: Array, space: PoseVectors = PLANAR) -> ContactSet:
        """World contacts seen from the object, without the free places.

        Args:
            world_T_object: one pose of shape (size,), or one for each contact, shape (n, size).
            space: kind of the pose vectors.
        """
        points, normals = space.to_object(world_T_object, self.points_m, self.normals)
        return ContactSet(points, normals, self.point_sigma_m, self.normal_sigma_rad, shared=self.shared)

    def with_errors_taken_out(self, errors: Mapping[str, Array]) -> ContactSet:
        """The contacts, and the free places before them, without the given errors that contacts of one finger share.

        Args:
            errors: of each finger, standard deviations, shape (k,); one that is missing has none.
        """
        shared = self.shared.of_count(len(self))
        back = -shared.offsets_m(errors)[:, None] * self.normals
        own = np.maximum(self.point_sigma_m**2 - shared.sigma_m**2, _LEAST_OWN_SHARE * self.point_sigma_m**2)
        free = self.free_m.copy()
        touching = self.free_of >= 0
        free[touching] += back[self.free_of[touching]]
        moved = replace(self, points_m=self.points_m + back, point_sigma_m=np.sqrt(own), free_m=free)
        return replace(moved, shared=shared.taken_out())

    def select(self, mask: NDArray[np.bool_] | NDArray[np.intp]) -> ContactSet:
        """The contacts picked by a boolean or index array."""
        return ContactSet(
            self.points_m[mask],
            self.normals[mask],
            self.point_sigma_m[mask],
            self.normal_sigma_rad[mask],
            shared=self.shared.of_count(len(self)).select(mask),
        )


def _free_places(
    grasp: Grasp, contacts: ContactSet, counted: Sequence[Contact], origin: Array
) -> tuple[Array, NDArray[np.intp]]:
    """Free places and the contact of each, by the approach paths; if those are unknown, in the fingertips.

    Args:
        grasp, contacts, counted: all contacts, and those that count.
        origin: of the object frame, world frame.
    """
    if not grasp.approach_paths:
        places = [fingertip_places(contacts.points_m[i], contacts.normals[i]) for i in range(len(contacts))]
        owners = list(range(len(contacts)))
    else:
        lines = [line for line in grasp.approach_paths if contacts.dimension == 3 or not _comes_down(line)]
        places = [(places_on_line(line) - origin)[:, : contacts.dimension] for line in lines]
        owners = [_contact_at_end(line, counted) for line in lines]
    free_of = np.repeat(np.array(owners, dtype=np.intp), [len(each) for each in places])
    return np.vstack([np.empty((0, contacts.dimension)), *places]), free_of


def _comes_down(line: ApproachPath) -> bool:
    """Whether a path is horizontal: one from above says nothing about the contour, as the object may be under it."""
    way = line.end_world_m - line.start_world_m
    return bool(abs(way[2]) > LARGEST_SLOPE * np.linalg.norm(way))


def _contact_at_end(line: ApproachPath, counted: Sequence[Contact]) -> int:
    """Index of the contact that a line ends at, -1 for a finger that met nothing, or whose contact does not count."""
    own = [index for index, contact in enumerate(counted) if line.touched and contact.finger == line.finger]
    away_m = [float(np.linalg.norm(counted[index].point_world_m - line.end_world_m)) for index in own]
    return own[int(np.argmin(away_m))] if own else -1


def placement_sigma_m(contacts: ContactSet, row: Array, covariance: Array, space: PoseVectors) -> float:
    """How far the uncertainty of a pose moves the contacts along their normals, root mean square.

    Args:
        contacts: world frame.
        row, covariance: of the pose, shapes (size,) and (size, size).
        space: kind of the pose vector.
    """
    points, normals = space.to_object(row, contacts.points_m, contacts.normals)
    rows = space.by_row(row, points, normals, normals, np.zeros_like(normals))
    return float(np.sqrt(np.mean(np.einsum("ni,ij,nj->n", rows, covariance, rows))))


def planar_rotation(angle_rad: float) -> Array:
    """2 x 2 rotation matrix."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cosine, -sine], [sine, cosine]])


def _check(grasp: Grasp, points: Array, normals: Array, covariances: Array, normal_sigma: Array) -> None:
    where = f"grasp {grasp.index}"
    arrays = (points, normals, covariances, normal_sigma)
    if not all(np.isfinite(array).all() for array in arrays):
        raise TrackingError(
            "a contact has NaN or infinite entries", where=where, hint="Check the fingertip it came from"
        )
    if not np.isfinite(grasp.hand_motion_world.matrix()).all():
        raise TrackingError("the hand's motion has NaN or infinite entries", where=where)
    if len(points) and np.linalg.norm(normals, axis=1).min() < 1e-6:
        raise TrackingError("a contact normal has no length", where=where)
    if len(points) and np.abs(points).max() > FARTHEST_m:
        what = f"a contact lies {np.abs(points).max():.3g} m from the world's origin"
        raise TrackingError(what, where=where, hint="Move the origin near the object")
    if len(points) and float(np.ptp(points, axis=0).max()) > LARGEST_GRASP_m:
        raise TrackingError(
            f"contacts lie {np.ptp(points, axis=0).max():.3g} m apart",
            where=where,
            hint="Coordinates are metres; are these millimetres?",
        )
