"""Forearm to world from pictures of a board on the hand, while the hand moves.

The world marker in the same pictures gives the camera's pose; the board's pose on the hand is estimated too. Refined
over all corners: the pixel of corner c is that of ``camera_T_world world_T_mount mount_T_link link_T_board c``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import gtsam
import numpy as np
from gtsam import Pose3
from pydantic import Field

from calibration.forearm.board_chain import BoardChain, by_camera
from calibration.forearm.hand_eye import solve_ax_xb, solve_ax_zb
from calibration.steps.hand_chain import HandNoise, joints_of, link_motion, mount_T_link
from calibration.steps.observations import View
from calibration.steps.pose_residuals import PoseResidual
from calibration.steps.refinement import (
    BOARD,
    CAMERA,
    MOUNT,
    OFFSETS,
    JointOffset,
    Measurement,
    Solution,
    marginal,
    minimise,
    outliers,
    prior_of_offsets,
    variance_factor,
)
from drivers.camera.calibration import CameraCalibration
from drivers.camera.glass import Glass
from drivers.camera.markers import MarkerSettings
from drivers.camera.pose.board_pose import board_pose
from drivers.camera.pose.square_pose import marker_poses
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.poses import rotate, rotation_angle_rad, transform_points

_ROUNDS = 2
_FIXED_UNKNOWNS = 18  # mount, board and camera


class BoardNoise(HandNoise):
    """Errors of a picture, one standard deviation; the corners' as measured on rendered pictures of the rig's camera.

    Attributes:
        corner_px: of a detected corner, per axis.
        corner_bias_px: common bias of all corners of a static marker, per axis: sides curved by the lens.
        corner_own_px: remaining bias of each single corner.
        print_share: how well the size of each print is known: a bar of 100 mm measured to 0.03 mm.
    """

    corner_px: float = Field(default=0.05, gt=0.0)
    corner_bias_px: float = Field(default=0.03, ge=0.0)
    corner_own_px: float = Field(default=0.012, ge=0.0)
    print_share: float = Field(default=3e-4, gt=0.0)


class BoardProblem:
    """All pictures of one calibration.

    Args:
        views: pictures in which the board was found.
        camera: its lens.
        markers: the world marker, and the table's glass.
        link: what carries the board: ``palm``, or a finger's name for its distal link.
        noise: errors of a picture.

    Raises:
        ConfigurationError: the world marker is in none of them, or a board's corners allow no pose.
    """

    def __init__(
        self,
        views: Sequence[View],
        camera: CameraCalibration,
        markers: MarkerSettings,
        link: str = "palm",
        noise: BoardNoise | None = None,
    ) -> None:
        self.views, self.noise = tuple(views), noise or BoardNoise()
        self.joints = joints_of([link], views[0].pose.form)
        self._camera, self._markers, self._link = camera, markers, link
        self._glass = Glass(markers.glass_thickness_m, markers.glass_index)
        self._world_m = transform_points(markers.world_T_worldmarker.pose(), markers.world_corners_m)
        self._world_px, self._world_seen = standing_corners(self.views, markers.moved_px)
        self._start = self._first_values()

    @property
    def count(self) -> int:
        """Number of pictures."""
        return len(self.views)

    # --- solving -----------------------------------------------------------------------------------------------

    def solve(self, keep: Sequence[int] | None = None, near: Solution | None = None) -> Solution:
        """The refined solution from all pictures, or from those in ``keep``."""
        chosen = list(range(self.count) if keep is None else keep)
        values = near.values if near else self._start
        for _ in range(_ROUNDS if near is None else 1):
            measured = self._measurements(chosen, values)
            values = minimise(measured, values)
        return self._solution(measured, values, len(chosen))

    def _solution(self, measured: Sequence[Measurement], values: gtsam.Values, views: int) -> Solution:
        factor = variance_factor(measured, values, _FIXED_UNKNOWNS + len(self._prior_sigmas))
        offsets, spread = values.atVector(OFFSETS), np.sqrt(np.diag(marginal(measured, values, OFFSETS)))
        prior = self.noise.joint_offset_rad
        return Solution(
            world_T_mount=values.atPose3(MOUNT),
            covariance=max(1.0, factor) * marginal(measured, values, MOUNT),
            offsets={
                joint: JointOffset(float(offsets[i]), float(spread[i]), prior) for i, joint in enumerate(self.joints)
            },
            variance_factor=factor,
            values=values,
            numbers={"board_larger_share": float(offsets[-1])},
            others={f"{self._link}_T_board": values.atPose3(BOARD), "world_T_camera": values.atPose3(CAMERA)},
            outliers=outliers(measured[:views], values),
        )

    def _first_values(self) -> gtsam.Values:
        """Closed form: the camera from the world marker, board and mount from the hand's motion."""
        world_T_camera = self._world_T_camera()
        hands = [Pose3(mount_T_link(view.pose, self._link)) for view in self.views]
        boards = [self._camera_T_board(view) for view in self.views]
        answers = [solve(hands, boards) for solve in (solve_ax_zb, solve_ax_xb)]
        best = min(answers, key=lambda found: _misfit(hands, boards, found.hand_T_target, found.mount_T_camera))
        values = gtsam.Values()
        values.insert(MOUNT, world_T_camera * best.mount_T_camera.inverse())
        values.insert(BOARD, best.hand_T_target)
        values.insert(CAMERA, world_T_camera)
        values.insert(OFFSETS, np.zeros(len(self._prior_sigmas)))
        return values

    def _world_T_camera(self) -> Pose3:
        side_m = self._markers.world_side_m * self._markers.print_scale
        camera_T_marker = marker_poses(self._world_px, side_m, self._camera)[0].camera_T_marker
        return self._markers.world_T_worldmarker.pose() * camera_T_marker.inverse()

    def _camera_T_board(self, view: View) -> Pose3:
        found = board_pose(view.board_m, view.board_px, self._camera)
        if found is None:
            hint = "Remove the picture"
            raise ConfigurationError("no pose fits the board's corners", where="marker method", hint=hint)
        return found.camera_T_board

    # --- factors -----------------------------------------------------------------------------------------------

    def _measurements(self, chosen: Sequence[int], values: gtsam.Values) -> list[Measurement]:
        """Board factors first, then the world marker's, then the prior of the joint offsets."""
        boards = [self._board_measurement(self.views[index], values) for index in chosen]
        return [*boards, self._world_measurement(values), prior_of_offsets(self._prior_sigmas)]

    @property
    def _prior_sigmas(self) -> Array:
        """Of all small unknowns: the joints' offsets, and by which share the board is larger than it should be."""
        return np.append(np.full(len(self.joints), self.noise.joint_offset_rad), self.noise.print_share)

    def _world_measurement(self, values: gtsam.Values) -> Measurement:
        camera: Pose3 = values.atPose3(CAMERA)
        points = self._glass.apparent(self._world_m, np.asarray(camera.translation()))

        def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
            camera: Pose3 = values.atPose3(CAMERA)
            seen, slopes = self._camera.projection(transform_points(camera.inverse(), points))
            return (seen - self._world_px).ravel(), [_rows(slopes @ by_camera(camera, points))]

        _, slopes = self._camera.projection(transform_points(camera.inverse(), points))
        larger = rotate(camera.inverse(), points - points.mean(axis=0))
        size = self.noise.print_share * np.einsum("nij,nj->ni", slopes, larger).ravel()
        alike = self.noise.corner_bias_px * np.tile(np.eye(2), (len(points), 1))
        own = self.noise.corner_px**2 / self._world_seen + self.noise.corner_own_px**2
        covariance = own * np.eye(2 * len(points)) + alike @ alike.T + np.outer(size, size)
        return Measurement((CAMERA,), covariance, evaluate, robust=False)

    def _board_measurement(self, view: View, values: gtsam.Values) -> Measurement:
        about = values.atVector(OFFSETS)[:-1]
        chain = BoardChain(link_motion(view.pose, self._link, self.joints, about), about, view.board_m)
        shift = self._glass_shift(chain, values)

        def evaluate(values: gtsam.Values) -> tuple[Array, list[Array]]:
            places = chain.world_m(values) + shift
            camera: Pose3 = values.atPose3(CAMERA)
            seen, slopes = self._camera.projection(transform_points(camera.inverse(), places))
            turned = camera.rotation().matrix().T
            by_mount, by_board, by_offset = (turned @ part for part in chain.derivatives(values))
            parts = (by_mount, by_board, by_camera(camera, places), by_offset)
            return (seen - view.board_px).ravel(), [_rows(slopes @ part) for part in parts]

        _, (by_mount, _, _, by_offset) = evaluate(values)
        base = self.noise.base_sigma_m * by_mount[:, 3:]  # as if the mount had moved
        joints = self.noise.joint_noise_rad * by_offset[:, :-1]
        covariance = base @ base.T + joints @ joints.T + self.noise.corner_px**2 * np.eye(2 * len(view.board_px))
        return Measurement((MOUNT, BOARD, CAMERA, OFFSETS), covariance, evaluate)

    def _glass_shift(self, chain: BoardChain, values: gtsam.Values) -> Array:
        places = chain.world_m(values)
        return self._glass.apparent(places, np.asarray(values.atPose3(CAMERA).translation())) - places

    # --- residuals ---------------------------------------------------------------------------------------------

    def residuals(self, solution: Solution) -> tuple[PoseResidual, ...]:
        """Residual of each picture: the board's measured pose relative to the solution."""
        return tuple(self._residual(index, view, solution) for index, view in enumerate(self.views))

    def _residual(self, index: int, view: View, solution: Solution) -> PoseResidual:
        values = solution.values
        offsets = values.atVector(OFFSETS)[:-1]
        chain = BoardChain(link_motion(view.pose, self._link, self.joints, offsets), None, view.board_m)
        places = chain.world_m(values) + self._glass_shift(chain, values)
        camera: Pose3 = values.atPose3(CAMERA)
        expected_px, _ = self._camera.projection(transform_points(camera.inverse(), places))
        off = self._camera_T_board(replace(view, board_px=expected_px)).between(self._camera_T_board(view))
        pixels = float(np.sqrt(np.mean(np.sum((expected_px - view.board_px) ** 2, axis=1))))
        return PoseResidual(
            f"picture {index + 1}", float(np.linalg.norm(off.translation())), rotation_angle_rad(off), pixels
        )


def standing_corners(views: Sequence[View], moved_px: float) -> tuple[Array, int]:
    """Mean corners of the world marker, shape (4, 2), and in how many pictures it was seen.

    Raises:
        ConfigurationError: it is in none of them, or did not stand still.
    """
    numbers = [index for index, view in enumerate(views) if view.world_px is not None]
    if not numbers:
        hint = "Move the hand aside so that the camera sees it in at least some of the pictures"
        raise ConfigurationError("the world marker is not visible in any picture", where="marker method", hint=hint)
    corners = np.array([views[index].world_px for index in numbers])
    away = np.abs(corners - np.median(corners, axis=0)).max(axis=(1, 2))
    if away.max() > moved_px:
        worst = numbers[int(np.argmax(away))] + 1
        what = f"the world marker or the camera was moved: {away.max():.1f} px off in picture {worst}"
        raise ConfigurationError(what, where="marker method", hint="Fasten both and take the pictures again")
    return np.asarray(corners.mean(axis=0)), len(numbers)


def _rows(derivatives: Array) -> Array:
    """From (n, 2, k) to (2 n, k): the order of pixels in a residual."""
    return np.asarray(derivatives).reshape(-1, derivatives.shape[-1])


def _misfit(hands: Sequence[Pose3], boards: Sequence[Pose3], hand_T_board: Pose3, mount_T_camera: Pose3) -> float:
    """Sum of squared distances between both ways to the board."""
    offs = [
        (a * hand_T_board).translation() - (mount_T_camera * b).translation()
        for a, b in zip(hands, boards, strict=True)
    ]
    return float(np.sum(np.square(offs)))
