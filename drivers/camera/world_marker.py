"""The camera's pose from the world marker, whose corners are averaged as long as it does not move."""

from __future__ import annotations

from collections import deque

import numpy as np
from gtsam import Pose3

from drivers.camera.calibration import CameraCalibration
from drivers.camera.glass import Glass
from drivers.camera.markers import MarkerSettings
from drivers.camera.pose.square_pose import marker_poses, points_reprojection_px, refine_pose
from drivers.core.contacts import Array
from drivers.core.poses import transform_points

_AGREEING = 3
"""If this many consecutive pictures agree on another position, the marker or the camera was moved."""
_WINDOW = 10
"""Number of pictures whose mean is compared with that of the first ones, to detect slow drift."""


class WorldMarker:
    """Averages the world marker over all pictures so far.

    A picture that shows it elsewhere is refused. If several consecutive pictures agree, it or the camera was bumped:
    from then on every picture is refused, unless the settings say that the marker cannot move.
    """

    def __init__(self, camera: CameraCalibration, settings: MarkerSettings) -> None:
        self._camera, self._settings = camera, settings
        self._corners_px: Array | None = None
        self._count = 0
        self._strange: deque[Array] = deque(maxlen=_AGREEING)
        self._first_px: Array | None = None
        self._recent: deque[Array] = deque(maxlen=_WINDOW)
        self._pose: Pose3 | None = None
        self.moved = ""
        """Its observed movement, in plain English; "" while it stands still."""

    @property
    def frames(self) -> int:
        """Number of pictures in the mean."""
        return self._count

    @property
    def corners_px(self) -> Array | None:
        """Mean corners, shape (4, 2); None before the first sight."""
        return self._corners_px

    def add(self, corners_px: Array) -> str:
        """Take the marker's corners in one more picture; returns why the picture is refused, or ""."""
        if self.moved:
            return self.moved
        if self._corners_px is None:
            self._begin(corners_px)
            return ""
        away_px = float(np.abs(corners_px - self._corners_px).max())
        if away_px > self._settings.moved_px:
            return self._out_of_place(corners_px, away_px)
        self._strange.clear()
        self._average(corners_px)
        return self._creeping()

    def camera_T_world(self) -> Pose3 | None:
        """The world in the camera's frame; None before the first sight.

        A square allows two poses. The better one is refined twice: first to learn from where the camera looks through
        the glass, then with the apparent positions of the corners.
        """
        if self._corners_px is None:
            return None
        if self._pose is None:
            side_m = self._settings.world_side_m * self._settings.print_scale
            guess = marker_poses(self._corners_px, side_m, self._camera)[0].camera_T_marker
            pose = guess * self._settings.world_T_worldmarker.pose().inverse()
            for _ in range(2):
                pose = refine_pose(pose, self.apparent_corners_m(pose), self._corners_px, self._camera)
            self._pose = pose
        return self._pose

    def reprojection_px(self) -> float:
        """Root mean square reprojection error of the mean corners, pixels; NaN before the first sight."""
        pose = self.camera_T_world()
        if pose is None or self._corners_px is None:
            return float("nan")
        return points_reprojection_px(pose, self.apparent_corners_m(pose), self._corners_px, self._camera)

    def apparent_corners_m(self, camera_T_world: Pose3) -> Array:
        """Apparent positions of the marker's corners through the glass, shape (4, 3), world frame."""
        corners = transform_points(self._settings.world_T_worldmarker.pose(), self._settings.world_corners_m)
        return table_glass(self._settings).apparent(corners, np.array(camera_T_world.inverse().translation()))

    def _begin(self, corners_px: Array) -> None:
        self._corners_px, self._count, self._first_px = np.array(corners_px), 1, None
        self._recent, self._pose = deque([np.array(corners_px)], maxlen=_WINDOW), None
        self._strange.clear()

    def _average(self, corners_px: Array) -> None:
        assert self._corners_px is not None
        self._count += 1
        self._corners_px = self._corners_px + (corners_px - self._corners_px) / self._count
        self._recent.append(corners_px)
        self._pose = None
        if self._count == _WINDOW:
            self._first_px = self._corners_px

    def _out_of_place(self, corners_px: Array, away_px: float) -> str:
        self._strange.append(corners_px)
        agree = float(np.ptp(self._strange, axis=0).max()) <= self._settings.moved_px
        if len(self._strange) == _AGREEING and agree:
            self._move(np.mean(self._strange, axis=0), f"the world marker or the camera was moved: {away_px:.1f} px")
        return self.moved or f"the world marker is {away_px:.1f} px from its first position"

    def _creeping(self) -> str:
        """Detect drift in steps that are too small to see in one picture."""
        if self._first_px is None:
            return ""
        recent_px = np.mean(self._recent, axis=0)
        away_px = float(np.abs(recent_px - self._first_px).max())
        if away_px > self._settings.moved_px / 2:
            self._move(recent_px, f"the world marker or the camera drifts: {away_px:.1f} px so far")
        return self.moved

    def _move(self, corners_px: Array, words: str) -> None:
        if self._settings.world_marker_fixed:
            self._begin(corners_px)
        else:
            self.moved = f"{words} since the first picture"


def table_glass(settings: MarkerSettings) -> Glass:
    """The glass plate that the settings describe."""
    return Glass(settings.glass_thickness_m, settings.glass_index)
