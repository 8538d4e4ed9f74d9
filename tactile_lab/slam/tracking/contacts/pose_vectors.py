"""Pose vectors: their size, how they compose, and how contacts move with them.

Everything that smooths or proposes poses works on arrays of pose vectors and uses one of these classes for the
geometry, so that an object on a table (x, y, yaw) and one free in space (x, y, z, rotation vector) go through the same
code.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import Array
from drivers.core.poses import wrap_angle_rad
from tactile_lab.slam.tracking.contacts.motion import (
    MotionNoise,
    compose,
    deviation,
    inverse,
    planar_motion,
    spatial_pose,
)


class PoseVectors(Protocol):
    """Operations on one kind of pose vectors. Arrays of them have shape (n, size)."""

    @property
    def size(self) -> int:
        """Number of components: translation first, then rotation."""

    @property
    def translations(self) -> int:
        """Number of translational components."""

    def sigmas(self, noise: MotionNoise) -> Array:
        """Standard deviations of a re-orientation, shape (size,)."""

    def compose(self, motion: Array, rows: Array) -> Array:
        """``motion * pose``, both in the world (eq. 3.8)."""

    def inverse(self, rows: Array) -> Array:
        """The inverse of each pose."""

    def deviation(self, rows: Array, reference: Array) -> Array:
        """The noise v of eq. 3.7 that leads from the reference to the pose vectors."""

    def move(self, rows: Array, steps: Array) -> Array:
        """Pose vectors after small steps, in their usual range."""

    def motion(self, hand_motion_world: Pose3) -> Array:
        """The hand's motion as a pose vector."""

    def pose(self, row: Array, height_m: float) -> Pose3:
        """``world_T_object``, the origin of a planar pose at this height."""

    def to_object(self, rows: Array, points: Array, normals: Array) -> tuple[Array, Array]:
        """World contacts in the object frame.

        Args:
            rows: broadcast against the contacts without their last axis, shape (..., size).
            points, normals: shape (..., d).
        """

    def by_row(self, rows: Array, points: Array, normals: Array, by_points: Array, by_normals: Array) -> Array:
        """Chain rule: derivatives by the pose vector, shape (..., size), from those by object-frame points and normals.

        Arguments as those and the results of :meth:`to_object`.
        """

    def slip_derivatives(self, rows: Array, motions: Array) -> tuple[Array, Array]:
        """Derivatives of ``deviation(rows[k], compose(motions[k], rows[k - 1]))`` by row k and by row k - 1.

        Returns:
            Two arrays of shape (n - 1, size, size).
        """


class PlanarVectors:
    """An object on a table: (x_m, y_m, yaw_rad). Contacts may have two or three coordinates."""

    size = 3
    translations = 2

    def sigmas(self, noise: MotionNoise) -> Array:
        return noise.sigmas

    def compose(self, motion: Array, rows: Array) -> Array:
        return compose(motion, rows)

    def inverse(self, rows: Array) -> Array:
        return inverse(rows)

    def deviation(self, rows: Array, reference: Array) -> Array:
        return deviation(rows, reference)

    def move(self, rows: Array, steps: Array) -> Array:
        result = rows + steps
        result[..., 2] = wrap_angle_rad(result[..., 2])
        return np.asarray(result)

    def motion(self, hand_motion_world: Pose3) -> Array:
        return planar_motion(hand_motion_world)

    def pose(self, row: Array, height_m: float) -> Pose3:
        return spatial_pose(row, height_m)

    def to_object(self, rows: Array, points: Array, normals: Array) -> tuple[Array, Array]:
        cosine, sine = np.cos(rows[..., 2]), np.sin(rows[..., 2])
        arms = points[..., :2] - rows[..., :2]
        shape = (*np.broadcast_shapes(cosine.shape, points.shape[:-1]), points.shape[-1])
        placed, turned = np.empty(shape), np.empty(shape)
        placed[..., 2:], turned[..., 2:] = points[..., 2:], normals[..., 2:]
        for result, vectors in ((placed, arms), (turned, normals)):
            result[..., 0] = cosine * vectors[..., 0] + sine * vectors[..., 1]
            result[..., 1] = cosine * vectors[..., 1] - sine * vectors[..., 0]
        return placed, turned

    def by_row(self, rows: Array, points: Array, normals: Array, by_points: Array, by_normals: Array) -> Array:
        cosine, sine = np.cos(rows[..., 2]), np.sin(rows[..., 2])
        along_x = -(cosine * by_points[..., 0] - sine * by_points[..., 1])
        along_y = -(sine * by_points[..., 0] + cosine * by_points[..., 1])
        turning = by_points[..., 0] * points[..., 1] - by_points[..., 1] * points[..., 0]
        turning = turning + by_normals[..., 0] * normals[..., 1] - by_normals[..., 1] * normals[..., 0]
        result = np.empty((*turning.shape, 3))
        result[..., 0], result[..., 1], result[..., 2] = along_x, along_y, turning
        return result

    def slip_derivatives(self, rows: Array, motions: Array) -> tuple[Array, Array]:
        later = np.broadcast_to(np.eye(3), (len(rows) - 1, 3, 3))
        cosine, sine = np.cos(motions[1:, 2]), np.sin(motions[1:, 2])
        earlier = np.zeros((len(rows) - 1, 3, 3))
        earlier[:, 0, 0] = earlier[:, 1, 1] = -cosine
        earlier[:, 0, 1], earlier[:, 1, 0], earlier[:, 2, 2] = sine, -sine, -1.0
        return later, earlier


PLANAR = PlanarVectors()
"""The object stands on the table."""
