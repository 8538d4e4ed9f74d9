"""The object's pose and the camera's, estimated together from the corners of both markers, with their covariance.

A single square determines the camera's tilt poorly, and an error of the tilt moves an object that lies beside the world
marker. The object's own square also carries information about the tilt. So both poses are the unknowns of one least
squares problem, whose observations are all corners, each weighted by its noise. Its normal equations give the
covariance, including the contribution of the camera's pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.glass import Glass
from drivers.core.contacts import Array
from drivers.core.poses import transform_points

_PLANAR, _SPATIAL = (3, 4, 2), (0, 1, 2, 3, 4, 5)
"""The free parameters of the object's pose, out of rotation about and translation along x, y, z: x, y, yaw; or all."""
_ROUNDS, _ENOUGH = 6, 1e-7


@dataclass(frozen=True, eq=False)
class Corners:
    """The corners of one marker.

    Attributes:
        points_m: positions, shape (n, 3): in the world frame for the world marker, in the object frame for the
            object's.
        pixels: positions in the picture, shape (n, 2).
        sigma_px: error of each, per axis.
    """

    points_m: Array
    pixels: Array
    sigma_px: float


@dataclass(frozen=True, eq=False)
class JointPose:
    """The object's pose.

    Attributes:
        world_T_object: the pose.
        covariance: for changes along the world's axes about the object's origin: x, y (m) and yaw (rad), shape (3, 3);
            for an unconstrained object rotation (rad), then translation (m), shape (6, 6).
    """

    world_T_object: Pose3
    covariance: Array


def solve_jointly(
    camera: CameraCalibration,
    glass: Glass,
    start: tuple[Pose3, Pose3],
    world: Corners,
    target: Corners,
    *,
    planar: bool,
) -> JointPose:
    """Gauss-Newton from initial poses ``camera_T_world``, ``world_T_object``; a planar object keeps height and tilt."""
    problem = _Problem(camera, glass, world, target, _PLANAR if planar else _SPATIAL)
    camera_T_world, world_T_object = start
    for _ in range(_ROUNDS):
        rows, errors = problem.linearise(camera_T_world, world_T_object)
        change = np.asarray(np.linalg.lstsq(rows, -errors, rcond=None)[0], float)
        camera_T_world, world_T_object = problem.change(camera_T_world, world_T_object, change)
        if np.abs(change).max() < _ENOUGH:
            break
    return JointPose(world_T_object, np.asarray(np.linalg.pinv(rows.T @ rows)[6:, 6:]))


@dataclass(frozen=True, eq=False)
class _Problem:
    camera: CameraCalibration
    glass: Glass
    world: Corners
    target: Corners
    free: tuple[int, ...]

    def linearise(self, camera_T_world: Pose3, world_T_object: Pose3) -> tuple[Array, Array]:
        """Derivatives of all errors with respect to all unknowns, and the errors, in standard deviations.

        The change of the glass's shift with the poses is neglected: it is one per cent of a derivative and does not
        bias the result.
        """
        points = np.vstack([self.world.points_m, transform_points(world_T_object, self.target.points_m)])
        apparent = self.glass.apparent(points, np.array(camera_T_world.inverse().translation()))
        seen = transform_points(camera_T_world, apparent)
        pixels, by_place = self.camera.projection(seen)
        unit, is_object = np.eye(3), np.arange(len(points)) >= len(self.world.points_m)
        arm = points - np.array(world_T_object.translation())
        on_object = np.concatenate([-cross_matrices(arm), np.broadcast_to(unit, (len(points), 3, 3))], axis=2)
        moved = camera_T_world.rotation().matrix() @ on_object[..., list(self.free)] * is_object[:, None, None]
        by_camera = np.concatenate([-cross_matrices(seen), np.broadcast_to(unit, (len(points), 3, 3))], axis=2)
        slopes = by_place @ np.concatenate([by_camera, moved], axis=2)
        sigmas = np.where(is_object, self.target.sigma_px, self.world.sigma_px)[:, None]
        misses = pixels - np.vstack([self.world.pixels, self.target.pixels])
        return (slopes / sigmas[..., None]).reshape(-1, slopes.shape[2]), (misses / sigmas).ravel()

    def change(self, camera_T_world: Pose3, world_T_object: Pose3, change: Array) -> tuple[Pose3, Pose3]:
        """Both poses after a small change: six parameters of the camera, then the object's free ones along the world's
        axes.
        """
        full = np.zeros(6)
        full[list(self.free)] = change[6:]
        turned = Pose3.Expmap(np.concatenate([full[:3], np.zeros(3)])).rotation() * world_T_object.rotation()
        moved = Pose3(turned, np.array(world_T_object.translation()) + full[3:])
        return Pose3.Expmap(change[:6]) * camera_T_world, moved


def cross_matrices(vectors: Array) -> Array:
    """Matrices of the cross product with each vector (n, 3), shape (n, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
