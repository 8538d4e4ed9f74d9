"""The object's true pose from two markers seen through the table.

The world marker, which does not move, is averaged over frames and gives the camera's pose. The object's marker lies on
the table, so that only its place and its turn are free: the rays through its corners are cut with the plane in which
the marker lies, and the square is laid into the four points. Unlike the pose of a single square (both IPPE solutions
are given for comparison) this can not flip. The sideways shift of rays in the table's glass is taken into account for
both markers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose3, Rot3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.frames import Frame
from drivers.camera.glass import Glass
from drivers.camera.markers import (
    MarkerPose,
    MarkerSettings,
    detect,
    marker_corners,
    marker_poses,
    points_reprojection_px,
    refine_pose,
)
from tactile_lab.geometry.contacts import Array
from tactile_lab.geometry.poses import rotate, transform_points

FACE_DOWN = Pose3(Rot3(np.diag([1.0, -1.0, -1.0])), np.zeros(3))
"""A marker seen from below: its z points down."""


@dataclass(frozen=True, eq=False)
class ObjectSighting:
    """The object in one frame.

    Attributes:
        stamp_ns: arrival of the frame.
        world_T_object: its pose, constrained to the table.
        position_sigma_m, yaw_sigma_rad: standard deviations, per axis in the plane and about the vertical.
        fit_rms_m: how badly the square fits the four points on the table; large when the object is tilted or lifted.
        ambiguous: whether the marker on its own would allow two poses.
        unconstrained: the one or two poses of the object from its marker alone, better first.
        object_corners_px, world_corners_px: corners used, shape (4, 2); the world's are means over frames.
    """

    stamp_ns: int
    world_T_object: Pose3
    position_sigma_m: float
    yaw_sigma_rad: float
    fit_rms_m: float
    ambiguous: bool
    unconstrained: tuple[Pose3, ...]
    object_corners_px: Array
    world_corners_px: Array


class WorldMarker:
    """The camera's pose from the world marker, its corners averaged for as long as it does not move."""

    def __init__(self, camera: CameraCalibration, settings: MarkerSettings) -> None:
        self._camera, self._settings = camera, settings
        self._corners_px: Array | None = None
        self._count = 0

    @property
    def frames(self) -> int:
        """Frames in the mean."""
        return self._count

    @property
    def corners_px(self) -> Array | None:
        """Mean corners, shape (4, 2); None before the first sight."""
        return self._corners_px

    def add(self, corners_px: Array) -> None:
        """Take the marker's corners in one more frame; a jump begins a new mean."""
        mean = self._corners_px
        if mean is None or np.abs(corners_px - mean).max() > self._settings.moved_px:
            self._corners_px, self._count = np.array(corners_px), 1
            return
        self._count += 1
        self._corners_px = mean + (corners_px - mean) / self._count

    def camera_T_world(self) -> Pose3 | None:
        """The world in the camera's frame; None before the first sight.

        Of the two poses a square allows the better one is taken, then refined twice: once to know from where the
        camera looks through the glass, once with the corners where they seem to be.
        """
        if self._corners_px is None:
            return None
        guess = marker_poses(self._corners_px, self._settings.world_side_m, self._camera)[0].camera_T_marker
        pose = guess * self._settings.world_T_worldmarker.pose().inverse()
        for _ in range(2):
            pose = refine_pose(pose, self._apparent_corners_m(pose), self._corners_px, self._camera)
        return pose

    def reprojection_px(self) -> float:
        """Root mean square reprojection error of the mean corners, pixels; NaN before the first sight."""
        pose = self.camera_T_world()
        if pose is None or self._corners_px is None:
            return float("nan")
        return points_reprojection_px(pose, self._apparent_corners_m(pose), self._corners_px, self._camera)

    def _apparent_corners_m(self, camera_T_world: Pose3) -> Array:
        corners = transform_points(
            self._settings.world_T_worldmarker.pose(), marker_corners(self._settings.world_side_m)
        )
        return table_glass(self._settings).apparent(corners, np.array(camera_T_world.inverse().translation()))


def table_glass(settings: MarkerSettings) -> Glass:
    """The plate the settings describe."""
    return Glass(settings.glass_thickness_m, settings.glass_index)


class ObjectTracker:
    """Object poses from frames of one standing camera."""

    def __init__(self, camera: CameraCalibration, settings: MarkerSettings) -> None:
        self.world = WorldMarker(camera, settings)
        self._camera, self._settings = camera, settings
        self._object_T_marker = settings.object_T_objectmarker.pose()

    def object_pose(self, frame: Frame) -> ObjectSighting | None:
        """Where the object is in this frame; None when its marker is not seen, or the world marker never was."""
        seen = detect(frame.image, self._settings.dictionary)
        if self._settings.world_id in seen:
            self.world.add(seen[self._settings.world_id])
        corners_px = seen.get(self._settings.object_id)
        return None if corners_px is None else self.sighting(frame.stamp_ns, corners_px)

    def sighting(self, stamp_ns: int, corners_px: Array) -> ObjectSighting | None:
        """The object from the corners of its marker, shape (4, 2), which lies on the table, z = 0 of the world.

        None before the world marker was seen, or when the corners can not be on the table.
        """
        camera_T_world = self.world.camera_T_world()
        if camera_T_world is None:
            return None
        on_table = self._on_table(camera_T_world.inverse(), corners_px)
        return None if on_table is None else self._sighting(stamp_ns, camera_T_world, corners_px, on_table)

    def _on_table(self, world_T_camera: Pose3, corners_px: Array) -> Array | None:
        """The corners on the table, shape (4, 2), world; None when a ray never comes up to it."""
        rays = rotate(world_T_camera, self._camera.rays(corners_px))
        origin = np.array(world_T_camera.translation())
        if origin[2] >= 0.0 or np.any(rays[:, 2] <= 0.0):
            return None
        slope = rays[:, :2] / rays[:, 2:]
        return np.asarray(origin[:2] - origin[2] * slope - table_glass(self._settings).shift(slope))

    def _sighting(self, stamp_ns: int, camera_T_world: Pose3, corners_px: Array, on_table: Array) -> ObjectSighting:
        model = marker_corners(self._settings.object_side_m) @ FACE_DOWN.rotation().matrix().T
        place, yaw, rms = fit_in_plane(model[:, :2], on_table)
        world_T_marker = Pose3(Rot3.Yaw(yaw), np.array([*place, 0.0])) * FACE_DOWN
        alone = marker_poses(corners_px, self._settings.object_side_m, self._camera)
        marker_T_object = self._object_T_marker.inverse()
        position, turn = self._sigmas(camera_T_world)
        return ObjectSighting(
            stamp_ns=stamp_ns,
            world_T_object=world_T_marker * marker_T_object,
            position_sigma_m=position,
            yaw_sigma_rad=turn,
            fit_rms_m=rms,
            ambiguous=is_ambiguous(alone, self._settings.ambiguous_ratio),
            unconstrained=tuple(camera_T_world.inverse() * each.camera_T_marker * marker_T_object for each in alone),
            object_corners_px=corners_px,
            world_corners_px=np.array(self.world.corners_px),
        )

    def _sigmas(self, camera_T_world: Pose3) -> tuple[float, float]:
        """From the corners of both markers, each four at half a diagonal from the centre, and the table."""
        metres_per_px = abs(camera_T_world.inverse().z()) / float(np.mean(self._camera.focal_px))
        corner = self._settings.corner_sigma_px * metres_per_px
        mean_corner = corner / np.sqrt(self.world.frames)
        position = np.hypot(corner, mean_corner) / 2.0
        turn = np.hypot(corner / self._settings.object_side_m, mean_corner / self._settings.world_side_m) / np.sqrt(2)
        return float(np.hypot(position, self._settings.table_sigma_m)), float(
            np.hypot(turn, self._settings.table_sigma_rad)
        )


def fit_in_plane(model: Array, seen: Array) -> tuple[Array, float, float]:
    """The turn and shift in the plane that lay ``model`` (n, 2) onto ``seen`` (n, 2), by least squares.

    Returns:
        Where the model's origin comes to lie (2,), its angle (rad), and the root mean square misfit.
    """
    a, b = model - model.mean(axis=0), seen - seen.mean(axis=0)
    angle = float(np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b)))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    misfit = float(np.sqrt(np.mean(np.sum((a @ turn.T - b) ** 2, axis=1))))
    return seen.mean(axis=0) - turn @ model.mean(axis=0), angle, misfit


def is_ambiguous(poses: tuple[MarkerPose, ...], ratio: float) -> bool:
    """Whether the second pose of a square explains its corners nearly as well as the first."""
    return len(poses) > 1 and poses[1].reprojection_px < ratio * poses[0].reprojection_px
