"""Renders the markers as seen by the camera under the table, without a graphics library.

For every pixel near a marker, nine rays are traced through the lens and the glass plate to the marker's plane. The rest
of the picture is background and the dark underside of the object. Blur and noise are added last. The table's glass lies
between z = -thickness and z = 0; above it a ray continues in its old direction, displaced sideways by ``thickness *
(tan incidence - tan refraction)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.camera.calibration import CameraCalibration
from drivers.camera.opencv import cv2
from drivers.camera.rendering.settings import CameraSettings
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import rotate, transform_points

Image = NDArray[np.uint8]
_Picture = NDArray[np.float32]

_RAYS = 3  # rays per pixel and direction
_MARGIN_px = 3
_MARKER_MODULES = 6  # modules: 4 x 4 bits and a black frame
_BACKGROUND, _FOOT, _WHITE, _BLACK = 150.0, 70.0, 235.0, 20.0
_VIGNETTING = 0.18


@dataclass(frozen=True)
class PrintedMarker:
    """A printed ArUco marker: black square with half a module of white around it.

    Its frame has x to the right and y up on the print, z out of it.

    Attributes:
        dictionary: OpenCV's name, for instance ``DICT_4X4_50``.
        number: which marker of the dictionary.
        side_m: side of the black square.
    """

    dictionary: str
    number: int
    side_m: float


Placed: TypeAlias = tuple[PrintedMarker, Pose3]
"""A print and its ``world_T_marker``."""


class TableCamera:
    """The camera under the table.

    Args:
        lens: its optics; the picture's size must be stated.
        settings: where it stands, glass, sharpness and noise.
        rng: random numbers for the noise.

    Raises:
        ConfigurationError: the lens calibration does not state the picture size.
    """

    def __init__(self, lens: CameraCalibration, settings: CameraSettings, rng: np.random.Generator) -> None:
        if lens.size_px is None:
            raise ConfigurationError("the picture size is missing", where="simulated camera", hint="Set size_px")
        self._lens, self._settings, self._rng = lens, settings, rng
        self._size_px = lens.size_px
        self._pose = settings.world_T_camera.pose()

    def render(self, markers: tuple[Placed, ...], foot_world_m: Array) -> Image:
        """Draw one picture, shape (height, width).

        Args:
            markers: those on the table and under the object; a marker that faces up is invisible.
            foot_world_m: corners of the object's underside, shape (n, 3); drawn dark, behind the markers.
        """
        width, height = self._size_px
        picture = np.full((height, width), _BACKGROUND, np.float32)
        self._draw_foot(picture, foot_world_m)
        for marker, world_T_marker in markers:
            self._draw_marker(picture, marker, world_T_marker)
        picture *= self._brightness
        sharp = cv2.GaussianBlur(picture, (0, 0), self._settings.blur_px)
        noise = self._settings.noise_levels * self._rng.standard_normal(picture.shape, dtype=np.float32)
        return np.clip(sharp + noise, 0, 255).astype(np.uint8)

    def project(self, points_world_m: Array) -> Array:
        """Pixel positions, shape (n, 2), of points on or above the table, shape (n, 3).

        The sideways shift in the glass is computed for the straight ray; the error is a few micrometres.
        """
        seen = points_world_m - self._pose.translation()
        across = np.linalg.norm(seen[:, :2], axis=1)
        direction = seen[:, :2] / np.maximum(across, 1e-9)[:, None]
        apparent = points_world_m.copy()
        apparent[:, :2] += direction * _glass_shift_m(across / seen[:, 2], *self._glass)[:, None]
        return self._lens.project(transform_points(self._pose.inverse(), apparent))

    @property
    def _glass(self) -> tuple[float, float]:
        return self._settings.glass_thickness_m, self._settings.glass_index

    def _draw_foot(self, picture: _Picture, foot_world_m: Array) -> None:
        corners = np.rint(self.project(foot_world_m) * 16).astype(np.int32)  # sixteenths of a pixel
        cv2.fillPoly(picture, [corners], _FOOT, cv2.LINE_AA, 4)

    def _draw_marker(self, picture: _Picture, marker: PrintedMarker, pose: Pose3) -> None:
        window = self._window(marker, pose)
        if window is None:
            return
        rows, columns = window
        modules, half_modules = _half_modules(marker)
        across, up = self._hits(pose, window)
        scale = _MARKER_MODULES * 2 / marker.side_m
        column = np.floor(across * scale).astype(int) + half_modules // 2
        row = half_modules // 2 - 1 - np.floor(up * scale).astype(int)
        inside = (np.minimum(column, row) >= 0) & (np.maximum(column, row) < half_modules)
        shade = modules[np.clip(row, 0, half_modules - 1), np.clip(column, 0, half_modules - 1)]
        covered, ink = _pixel_means(inside.astype(np.float32)), _pixel_means(np.where(inside, shade, 0))
        picture[rows, columns] = picture[rows, columns] * (1 - covered) + ink

    def _window(self, marker: PrintedMarker, pose: Pose3) -> tuple[slice, slice] | None:
        """Rows and columns that contain the marker; None if it faces away or lies outside the picture."""
        facing = (pose.translation() - self._pose.translation()) @ pose.rotation().matrix()[:, 2]
        if facing >= 0:
            return None
        half = marker.side_m / 2 * (1 + 1 / _MARKER_MODULES)
        square = half * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        pixels = self.project(transform_points(pose, square))
        low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - _MARGIN_px, 0)
        high = np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + _MARGIN_px + 1, self._size_px)
        return None if np.any(high - low < 2) else (slice(low[1], high[1]), slice(low[0], high[0]))

    @cached_property
    def _brightness(self) -> _Picture:
        width, height = self._size_px
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        radius = np.hypot(columns - width / 2, rows - height / 2) / (width / 2)
        return np.asarray(1 - _VIGNETTING * radius**2, np.float32)

    def _hits(self, world_T_marker: Pose3, window: tuple[slice, slice]) -> tuple[Array, Array]:
        """Intersections of a window's rays with the marker's plane: marker x and y, metres, for every ray of every
        pixel.

        The intersection is computed at pixel centres and interpolated between them, since it changes smoothly.
        """
        rotation = world_T_marker.rotation().matrix()
        ground_m, slopes = _rays_above(self._lens, self._settings.world_T_camera, *self._glass)
        start = (ground_m[window] - world_T_marker.translation()) @ rotation
        slope = slopes[window] @ rotation
        crossing = start[..., :2] - slope[..., :2] * (start[..., 2:] / slope[..., 2:])
        size = (_RAYS * crossing.shape[1], _RAYS * crossing.shape[0])
        fine = np.asarray(cv2.resize(crossing, size, interpolation=cv2.INTER_LINEAR), float)
        return fine[..., 0], fine[..., 1]


@lru_cache(maxsize=2)
def _rays_above(
    lens: CameraCalibration, world_T_camera: RigidTransform, glass_thickness_m: float, glass_index: float
) -> tuple[Array, Array]:
    """Each pixel's ray above the table: its point at z = 0, and its direction per metre of height.

    Both have shape (height, width, 3), world frame. They are the same for all sessions on one rig.
    """
    assert lens.size_px is not None
    (width, height), pose = lens.size_px, world_T_camera.pose()
    pixels = np.stack(np.meshgrid(np.arange(float(width)), np.arange(float(height))), axis=-1).reshape(-1, 2)
    rays = rotate(pose, lens.rays(pixels))
    slope = rays[:, :2] / rays[:, 2:]
    tangent = np.linalg.norm(slope, axis=1)
    glass_m = _glass_shift_m(tangent, glass_thickness_m, glass_index) / np.maximum(tangent, 1e-9)
    centre_m = pose.translation()
    ground_m = centre_m[:2] - slope * (centre_m[2] + glass_m[:, None])
    up = np.ones((len(rays), 1))
    return np.hstack([ground_m, 0 * up]).reshape(height, width, 3), np.hstack([slope, up]).reshape(height, width, 3)


def _glass_shift_m(tangent: Array, thickness_m: float, index: float) -> Array:
    """Sideways shift of a ray by the glass, from the tangent of its angle to the vertical."""
    sine = tangent / np.sqrt(1 + tangent**2) / index
    return np.asarray(thickness_m * (tangent - sine / np.sqrt(1 - sine**2)))


def _half_modules(marker: PrintedMarker) -> tuple[_Picture, int]:
    """Grey levels of the print in half modules, including the white border, and their number across."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, marker.dictionary))
    bits = cv2.aruco.generateImageMarker(dictionary, marker.number, 2 * _MARKER_MODULES)
    print_ = np.pad(bits, 1, constant_values=255)
    return np.where(print_ > 127, _WHITE, _BLACK).astype(np.float32), len(print_)


def _pixel_means(values: NDArray[np.floating]) -> _Picture:
    rows, columns = values.shape
    blocks = values.reshape(rows // _RAYS, _RAYS, columns // _RAYS, _RAYS)
    return np.asarray(blocks.mean(axis=(1, 3)), np.float32)
