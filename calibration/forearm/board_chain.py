"""A board on the hand in the world and in the camera, as a function of all unknowns."""

from __future__ import annotations

import gtsam
import numpy as np
from gtsam import Pose3

from calibration.steps.hand_chain import LinkMotion
from calibration.steps.refinement import BOARD, MOUNT, OFFSETS
from drivers.core.contacts import Array
from drivers.core.poses import transform_points
from drivers.core.rotations import skew


class BoardChain:
    """A board's corners in the world as a function of all unknowns, linear in the joint offsets.

    The last of the offsets is the relative scale error of the board.
    """

    def __init__(self, motion: LinkMotion, about_rad: Array | None, board_m: Array) -> None:
        self._motion, self._about, self._board_m = motion, about_rad, board_m

    def _link(self, values: gtsam.Values) -> Array:
        if self._about is None:
            return self._motion.mount_T_link
        return self._motion.at(values.atVector(OFFSETS)[:-1] - self._about)

    def _corners_m(self, values: gtsam.Values) -> Array:
        """In the board's frame, shape (n, 3)."""
        return np.asarray(self._board_m * (1.0 + values.atVector(OFFSETS)[-1]))

    def world_m(self, values: gtsam.Values) -> Array:
        """Corners, shape (n, 3)."""
        whole = values.atPose3(MOUNT).matrix() @ self._link(values) @ values.atPose3(BOARD).matrix()
        return np.asarray(self._corners_m(values) @ whole[:3, :3].T + whole[:3, 3])

    def derivatives(self, values: gtsam.Values) -> tuple[Array, Array, Array]:
        """Of the corners in the world by mount (n, 3, 6), board (n, 3, 6) and offsets (n, 3, m)."""
        world_R_mount = values.atPose3(MOUNT).rotation().matrix()
        link, board, corners = self._link(values), values.atPose3(BOARD), self._corners_m(values)
        on_link = np.column_stack([transform_points(board, corners), np.ones(len(corners))])
        in_mount = on_link @ link[:3].T
        world_R_board = world_R_mount @ link[:3, :3] @ board.rotation().matrix()
        by_mount, by_board = _by_pose(world_R_mount, in_mount), _by_pose(world_R_board, corners)
        moves = world_R_mount @ np.einsum("kij,nj->nik", self._motion.derivatives[:, :3], on_link)
        larger = self._board_m @ world_R_board.T
        return by_mount, by_board, np.concatenate([moves, larger[..., None]], axis=2)


def _by_pose(rotation: Array, points_m: Array) -> Array:
    """Derivatives of points (n, 3) of a body by a small motion of it on its own side, shape (n, 3, 6)."""
    turns = -rotation @ skew(points_m)
    return np.concatenate([turns, np.broadcast_to(rotation, turns.shape)], axis=2)


def by_camera(world_T_camera: Pose3, points_world_m: Array) -> Array:
    """Derivatives of points (n, 3) in the camera's frame by a small motion of the camera, shape (n, 3, 6)."""
    turns = skew(transform_points(world_T_camera.inverse(), points_world_m))
    return np.concatenate([turns, np.broadcast_to(-np.eye(3), turns.shape)], axis=2)
