"""Pose vectors of an object that is free in space: (x, y, z, rotation vector)."""

from __future__ import annotations

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.rotations import exponential, logarithm, right_jacobian
from tactile_lab.slam.tracking.contacts.motion import MotionNoise


class SpatialVectors:
    """(x_m, y_m, z_m, wx, wy, wz), w being the rotation vector in radians; contacts have three coordinates.

    The rotation vector is a regular chart below one full turn; it is brought back to half a turn after every step, so
    that derivatives by it always exist. The noise of eq. 3.7 rotates and shifts the object in the world.
    """

    size = 6
    translations = 3

    def sigmas(self, noise: MotionNoise) -> Array:
        return np.array(3 * [noise.translation_m] + 3 * [noise.rotation_rad])

    def compose(self, motion: Array, rows: Array) -> Array:
        turn = exponential(motion[..., 3:])
        shift = np.einsum("...ij,...j->...i", turn, rows[..., :3]) + motion[..., :3]
        return np.concatenate([shift, logarithm(turn @ exponential(rows[..., 3:]))], axis=-1)

    def inverse(self, rows: Array) -> Array:
        shift = -np.einsum("...ji,...j->...i", exponential(rows[..., 3:]), rows[..., :3])
        return np.concatenate([shift, -rows[..., 3:]], axis=-1)

    def deviation(self, rows: Array, reference: Array) -> Array:
        turn = exponential(rows[..., 3:]) @ np.swapaxes(exponential(reference[..., 3:]), -1, -2)
        return np.concatenate([rows[..., :3] - reference[..., :3], logarithm(turn)], axis=-1)

    def move(self, rows: Array, steps: Array) -> Array:
        result = rows + steps
        result[..., 3:] = logarithm(exponential(result[..., 3:]))
        return np.asarray(result)

    def motion(self, hand_motion_world: Pose3) -> Array:
        return self.vector(hand_motion_world)

    def vector(self, pose: Pose3) -> Array:
        return np.concatenate([pose.translation(), logarithm(pose.rotation().matrix())])

    def pose(self, row: Array, height_m: float) -> Pose3:
        """The height is that of a planar pose's origin and has no meaning here."""
        return Pose3(Rot3(exponential(row[3:])), np.asarray(row[:3]))

    def to_object(self, rows: Array, points: Array, normals: Array) -> tuple[Array, Array]:
        turns = exponential(rows[..., 3:])
        arms = points - rows[..., :3]
        placed = np.einsum("...ji,...j->...i", turns, arms)
        return placed, np.einsum("...ji,...j->...i", turns, np.broadcast_to(normals, placed.shape))

    def by_row(self, rows: Array, points: Array, normals: Array, by_points: Array, by_normals: Array) -> Array:
        turns = exponential(rows[..., 3:])
        by_shift = -np.einsum("...ij,...j->...i", turns, np.broadcast_to(by_points, points.shape))
        by_turn = np.cross(by_points, points) + np.cross(by_normals, normals)
        jacobian = right_jacobian(rows[..., 3:])
        return np.concatenate([by_shift, np.einsum("...ji,...j->...i", jacobian, by_turn)], axis=-1)

    def slip_derivatives(self, rows: Array, motions: Array) -> tuple[Array, Array]:
        predicted = self.compose(motions[1:], rows[:-1])
        slip = self.deviation(rows[1:], predicted)[:, 3:]
        turned = np.linalg.inv(right_jacobian(slip)) @ exponential(predicted[:, 3:])
        later = np.zeros((len(rows) - 1, 6, 6))
        earlier = np.zeros_like(later)
        later[:, :3, :3] = np.eye(3)
        later[:, 3:, 3:] = turned @ right_jacobian(rows[1:, 3:])
        earlier[:, :3, :3] = -exponential(motions[1:, 3:])
        earlier[:, 3:, 3:] = -turned @ right_jacobian(rows[:-1, 3:])
        return later, earlier


SPATIAL = SpatialVectors()
"""The object is held free in space."""
