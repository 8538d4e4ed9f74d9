"""The object's true pose from two markers seen through the table.

The world marker, which does not move, is averaged over frames and gives the camera's pose. The object's marker lies on
the table, so only its position and yaw are unknown: the rays through its corners are intersected with the marker's
plane, and the square is fitted to the four points. From this start all corners are fitted together. Unlike the pose of
a single square (whose two IPPE solutions are also reported), this pose cannot flip. The sideways shift of rays in the
table's glass is taken into account for both markers. Where a picture does not determine the pose, the reason is
returned instead of a pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np
from gtsam import Pose3, Rot3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.detection import detection
from drivers.camera.frames import Detection, Frame
from drivers.camera.markers import MarkerSettings
from drivers.camera.pose.joint_pose import Corners, JointPose, solve_jointly
from drivers.camera.pose.square_pose import MarkerPose, marker_poses, points_reprojection_px, refine_pose
from drivers.camera.world_marker import WorldMarker, table_glass
from drivers.core.contacts import Array
from drivers.core.poses import rotate, transform_points

FACE_DOWN = Pose3(Rot3(np.diag([1.0, -1.0, -1.0])), np.zeros(3))
"""A marker seen from below: its z points down."""
_SPARE = 2
"""A square's corners give eight numbers; a pose has six."""
_MEAN_FLOOR_px = 0.02
"""Error of the world marker's corners that averaging does not remove."""


@dataclass(frozen=True, eq=False)
class ObjectSighting:
    """The object in one frame.

    Attributes:
        stamp_ns: arrival of the frame.
        world_T_object: its pose, constrained to the table unless the settings allow any pose.
        covariance: of x, y (m) and yaw (rad), shape (3, 3), world axes; for an unconstrained object shape (6, 6),
            rotation first.
        position_sigma_m, yaw_sigma_rad: standard deviations: the larger one in the plane, and about the vertical.
        fit_rms_m: misfit of the square to the four points on the table; large if the object is tilted or lifted.
        ambiguous: whether the marker alone would allow two poses.
        unconstrained: the one or two poses of the object from its marker alone, the better one first.
        reprojection_px: error of each of these.
        object_corners_px, world_corners_px: corners used, shape (4, 2); the world's are means over frames.
    """

    stamp_ns: int
    world_T_object: Pose3
    covariance: Array
    position_sigma_m: float
    yaw_sigma_rad: float
    fit_rms_m: float
    ambiguous: bool
    unconstrained: tuple[Pose3, ...]
    reprojection_px: tuple[float, ...]
    object_corners_px: Array
    world_corners_px: Array


@dataclass(frozen=True, eq=False)
class Observation:
    """The result of one frame: a sighting, or the reason why there is none."""

    stamp_ns: int
    sighting: ObjectSighting | None
    problem: str = ""


class ObjectTracker:
    """Computes object poses from the frames of one fixed camera."""

    def __init__(self, camera: CameraCalibration, settings: MarkerSettings) -> None:
        self.world = WorldMarker(camera, settings)
        self._camera, self._settings = camera, settings
        self._object_T_marker = settings.object_T_objectmarker.pose()

    def observe(self, frame: Frame) -> Observation:
        """Process one frame: add the world marker to its mean, and locate the object or say why that fails."""
        found = detection_in(frame, self._settings.dictionary)
        return self.locate(frame.stamp_ns, found, self.take_world(found))

    def take_world(self, found: Detection) -> str:
        """Add the world marker of one frame to the mean; returns why the frame cannot be used, or ""."""
        if problem := self._picture_problem(found):
            return problem
        world = found.markers.get(self._settings.world_id)
        if world is None:
            return self.world.moved
        return self._blur_problem(self._settings.world_id, world.blur_px) or self.world.add(world.corners_px)

    def locate(self, stamp_ns: int, found: Detection, problem: str = "") -> Observation:
        """Locate the object in a frame; ``problem`` is what :meth:`take_world` returned for this frame."""
        marker = found.markers.get(self._settings.object_id)
        if not problem and marker is None:
            problem = f"the object's marker {self._settings.object_id} is not visible"
        if problem or marker is None:
            return Observation(stamp_ns, None, problem)
        if problem := self._blur_problem(self._settings.object_id, marker.blur_px):
            return Observation(stamp_ns, None, problem)
        return self._check(self.sighting(stamp_ns, marker.corners_px), stamp_ns)

    def sighting(self, stamp_ns: int, corners_px: Array) -> ObjectSighting | None:
        """The object from the corners of its marker, shape (4, 2); the marker lies on the table, z = 0 of the world.

        None before the world marker was seen, or if the corners cannot be on the table.
        """
        camera_T_world = self.world.camera_T_world()
        if camera_T_world is None:
            return None
        on_table = self._on_table(camera_T_world.inverse(), corners_px)
        return None if on_table is None else self._sighting(stamp_ns, camera_T_world, corners_px, on_table)

    def _picture_problem(self, found: Detection) -> str:
        if found.dictionary != self._settings.dictionary:
            return f"markers of {found.dictionary} were detected, not of {self._settings.dictionary}"
        if self._camera.size_px is not None and found.size_px != self._camera.size_px:
            made, seen = (" x ".join(map(str, size)) for size in (self._camera.size_px, found.size_px))
            return f"the picture has {seen} pixels, but the lens was calibrated with {made}"
        return ""

    def _blur_problem(self, number: int, blur_px: float) -> str:
        largest = self._settings.largest_blur_px
        if blur_px <= largest:
            return ""
        if not isfinite(blur_px):
            return f"the edges of marker {number} cannot be measured: it may be partly covered, in glare, or too small"
        return f"blurred: the edges of marker {number} are {blur_px:.1f} px wide, at most {largest:g} px are accepted"

    def _check(self, sighting: ObjectSighting | None, stamp_ns: int) -> Observation:
        if sighting is None:
            seen = self.world.frames > 0
            problem = (
                "the marker's corners cannot lie on the table" if seen else ("the world marker has not been seen yet")
            )
        elif self._settings.freedom == "spatial":
            problem = _ambiguity(sighting) if sighting.ambiguous else ""
        else:
            problem = self._misfit(sighting.fit_rms_m)
        return Observation(stamp_ns, None if problem else sighting, problem)

    def _misfit(self, fit_rms_m: float) -> str:
        if fit_rms_m <= self._settings.largest_misfit_m:
            return ""
        return (
            f"the marker does not lie flat on the table (misfit {1e3 * fit_rms_m:.1f} mm): lifted, tilted or in motion"
        )

    def _on_table(self, world_T_camera: Pose3, corners_px: Array) -> Array | None:
        """The corners on the table, shape (4, 2), world; None if a ray does not reach the table."""
        rays = rotate(world_T_camera, self._camera.rays(corners_px))
        origin = np.array(world_T_camera.translation())
        if origin[2] >= 0.0 or np.any(rays[:, 2] <= 0.0):
            return None
        slope = rays[:, :2] / rays[:, 2:]
        return np.asarray(origin[:2] - origin[2] * slope - table_glass(self._settings).shift(slope))

    def _sighting(self, stamp_ns: int, camera_T_world: Pose3, corners_px: Array, on_table: Array) -> ObjectSighting:
        model = self._settings.object_corners_m @ FACE_DOWN.rotation().matrix().T
        place, yaw, rms = fit_in_plane(model[:, :2], on_table)
        marker_T_object = self._object_T_marker.inverse()
        on_plane = Pose3(Rot3.Yaw(yaw), np.array([*place, 0.0])) * FACE_DOWN * marker_T_object
        alone = self._alone(camera_T_world, corners_px)
        free = tuple(camera_T_world.inverse() * each.camera_T_marker * marker_T_object for each in alone)
        found = self._jointly(camera_T_world, on_plane if self._settings.freedom == "planar" else free[0], corners_px)
        position_sigma_m, yaw_sigma_rad = _sigmas(found.covariance)
        return ObjectSighting(
            stamp_ns=stamp_ns,
            world_T_object=found.world_T_object,
            covariance=found.covariance,
            position_sigma_m=position_sigma_m,
            yaw_sigma_rad=yaw_sigma_rad,
            fit_rms_m=rms,
            ambiguous=is_ambiguous(alone, self._settings.corner_sigma_px, self._settings.ambiguous_sigmas),
            unconstrained=free,
            reprojection_px=tuple(each.reprojection_px for each in alone),
            object_corners_px=corners_px,
            world_corners_px=np.array(self.world.corners_px),
        )

    def _alone(self, camera_T_world: Pose3, corners_px: Array) -> tuple[MarkerPose, ...]:
        """The poses that the marker's corners alone allow, seen through the glass, the better one first."""
        side_m = self._settings.object_side_m * self._settings.print_scale
        poses = [found.camera_T_marker for found in marker_poses(corners_px, side_m, self._camera)]
        glass, corners = table_glass(self._settings), self._settings.object_corners_m
        eye = np.array(camera_T_world.inverse().translation())
        refined = []
        for pose in poses:
            for _ in range(2 if glass.thickness_m else 0):
                bent = glass.apparent(transform_points(camera_T_world.inverse() * pose, corners), eye)
                seen = transform_points(pose.inverse() * camera_T_world, bent)
                pose = refine_pose(pose, seen, corners_px, self._camera)
            bent = glass.apparent(transform_points(camera_T_world.inverse() * pose, corners), eye)
            refined.append(MarkerPose(pose, points_reprojection_px(camera_T_world, bent, corners_px, self._camera)))
        return tuple(sorted(refined, key=lambda found: found.reprojection_px))

    def _jointly(self, camera_T_world: Pose3, start: Pose3, corners_px: Array) -> JointPose:
        settings, sigma_px = self._settings, self._settings.corner_sigma_px
        is_planar = settings.freedom == "planar"
        mean_px = float(np.hypot(sigma_px / np.sqrt(self.world.frames), _MEAN_FLOOR_px))
        world_points_m = transform_points(settings.world_T_worldmarker.pose(), settings.world_corners_m)
        object_points_m = transform_points(self._object_T_marker, settings.object_corners_m)
        found = solve_jointly(
            self._camera,
            table_glass(settings),
            (camera_T_world, start),
            Corners(world_points_m, np.array(self.world.corners_px), mean_px),
            Corners(object_points_m, corners_px, sigma_px),
            planar=is_planar,
        )
        shift, turn = settings.table_sigma_m**2, settings.table_sigma_rad**2
        glue = np.diag([shift, shift, turn] if is_planar else [turn] * 3 + [shift] * 3)
        return JointPose(found.world_T_object, found.covariance + glue)


def detection_in(frame: Frame, dictionary: str) -> Detection:
    """The markers found when the frame was taken; otherwise those detected in its picture now."""
    if frame.detection is not None:
        return frame.detection
    return Detection(dictionary, (0, 0), {}) if frame.image is None else detection(frame.image, dictionary)


def fit_in_plane(model: Array, seen: Array) -> tuple[Array, float, float]:
    """The rotation and translation in the plane that map ``model`` (n, 2) onto ``seen`` (n, 2), by least squares.

    Returns:
        The position of the model's origin (2,), its angle (rad), and the root mean square misfit.
    """
    a, b = model - model.mean(axis=0), seen - seen.mean(axis=0)
    angle = float(np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b)))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    misfit = float(np.sqrt(np.mean(np.sum((a @ turn.T - b) ** 2, axis=1))))
    return seen.mean(axis=0) - turn @ model.mean(axis=0), angle, misfit


def is_ambiguous(poses: tuple[MarkerPose, ...], corner_sigma_px: float, sigmas: float) -> bool:
    """Whether noise of the corners could make the wrong one of a square's two poses look better.

    The log likelihood ratio of the poses is the difference of their sums of squared errors, divided by twice the
    variance of a corner. If the poses' corners are d apart, this difference is normally distributed for the true pose,
    with mean d^2 and a standard deviation of 2 d times that of a corner. So, whatever d is, the wrong pose looks better
    by more than (sigmas * a corner's deviation)^2 at most as often as a normal variable exceeds ``sigmas`` standard
    deviations. That holds for two given poses; since both are fitted to the corners, it happens a few times as often.

    Args:
        poses: the better one first.
        corner_sigma_px: error of a corner per axis; a larger error is assumed if the residuals of the better pose are
            larger.
        sigmas: required confidence, in standard deviations.
    """
    if len(poses) < 2:
        return False
    better, other = (4 * pose.reprojection_px**2 for pose in poses[:2])
    variance_px2 = max(corner_sigma_px**2, better / _SPARE)
    return other - better < sigmas**2 * variance_px2


def _sigmas(covariance: Array) -> tuple[float, float]:
    """Standard deviations of the position, along its larger axis in the plane (m), and about the vertical (rad)."""
    place = covariance[:2, :2] if len(covariance) == 3 else covariance[3:5, 3:5]
    return float(np.sqrt(np.linalg.eigvalsh(place)[-1])), float(np.sqrt(covariance[2, 2]))


def _ambiguity(sighting: ObjectSighting) -> str:
    errors = " and ".join(f"{error:.2f}" for error in sighting.reprojection_px)
    return f"ambiguous: the marker allows two poses (reprojection errors {errors} px)"
