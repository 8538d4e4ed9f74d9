"""The camera's lens: from our own YAML files, or from the files of OpenCV's calibration programs."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from drivers.camera.distortion import Distortion
from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel, loads, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import LARGEST_YAML_bytes, open_plain, read_bounded

_DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
_OPENCV_HEAD, _OPENCV_MATRIX = b"%YAML:1.0", b"!!opencv-matrix"


class CameraCalibration(StrictModel):
    """A pinhole camera with Brown's distortion, with OpenCV's parameters.

    Attributes:
        focal_px: focal lengths along x and y, pixels.
        centre_px: principal point, pixels.
        distortion: k1, k2, p1, p2, k3 and so on; 0, 4, 5, 8, 12 or 14 coefficients.
        size_px: width and height of the pictures it was made for; None if the file does not say.
    """

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...] = ()
    size_px: tuple[int, int] | None = None
    note: str = Field(default="", max_length=2000)

    @field_validator("focal_px")
    @classmethod
    def _positive(cls, value: tuple[float, float]) -> tuple[float, float]:
        if min(value) <= 0.0:
            raise ValueError("focal lengths must be greater than 0")
        return value

    @field_validator("distortion")
    @classmethod
    def _known_length(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if len(value) not in _DISTORTION_LENGTHS:
            raise ValueError(f"{len(value)} distortion coefficients; OpenCV supports {_DISTORTION_LENGTHS}")
        return value

    @property
    def matrix(self) -> Array:
        """Camera matrix, shape (3, 3), pixels."""
        return np.array(
            [[self.focal_px[0], 0.0, self.centre_px[0]], [0.0, self.focal_px[1], self.centre_px[1]], [0, 0, 1]]
        )

    @property
    def distortion_coefficients(self) -> Array:
        """Distortion in OpenCV's order, at least four coefficients."""
        return np.array(self.distortion or (0.0,) * 4)

    def rays(self, pixels: Array) -> Array:
        """Directions of pixels (n, 2) without distortion: shape (n, 3), camera frame, z = 1."""
        pixels = np.asarray(pixels, float).reshape(-1, 2)
        points = self._bending.undistorted(pixels, np.array(self.focal_px), np.array(self.centre_px))
        return np.hstack([points, np.ones((len(points), 1))])

    def project(self, points_camera_m: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in the camera frame."""
        return np.asarray(self._bending.distorted(_at_one(points_camera_m)) * self.focal_px + self.centre_px)

    def projection(self, points_camera_m: Array) -> tuple[Array, Array]:
        """Pixels (n, 2) of points (n, 3) in the camera frame, and their derivatives with respect to the points (n, 2,
        3).
        """
        points = _at_one(points_camera_m)
        by_point = self._bending.slopes(points) * np.array(self.focal_px)[:, None]
        by_depth = -by_point @ points[:, :, None]
        by_place = np.concatenate([by_point, by_depth], axis=2) / points_camera_m[:, 2, None, None]
        return np.asarray(self._bending.distorted(points) * self.focal_px + self.centre_px), by_place

    @cached_property
    def _bending(self) -> Distortion:
        return Distortion(self.distortion)


def _at_one(points_camera_m: Array) -> Array:
    """Where the rays to points (n, 3) are at a distance of one, shape (n, 2)."""
    return np.asarray(points_camera_m[:, :2] / points_camera_m[:, 2:])


def load_camera(path: Path) -> CameraCalibration:
    """Read a camera calibration: our YAML, or OpenCV's (known by its ``%YAML:1.0`` head).

    Raises:
        ConfigurationError: the file cannot be read, or is not a calibration.
    """
    return _opencv(path) if is_opencv(path) else load_parameters(path, CameraCalibration)


def is_opencv(path: Path) -> bool:
    """Whether a file has OpenCV's header; such a file does not name its camera. Raises ConfigurationError."""
    try:
        with open_plain(path) as file:
            return file.read(len(_OPENCV_HEAD)) == _OPENCV_HEAD
    except OSError as error:
        raise ConfigurationError(f"cannot be read ({error.strerror})", where=str(path)) from error


def _opencv(path: Path) -> CameraCalibration:
    """OpenCV's files are YAML but for their first line and the tags of their matrices."""
    text = read_bounded(path, LARGEST_YAML_bytes).partition(b"\n")[2].replace(_OPENCV_MATRIX, b"")
    found = loads(text, str(path))
    names = ("camera_matrix", "distortion_coefficients")
    matrix, distortion = (_matrix(found, name) for name in names)
    if matrix is None or distortion is None or matrix.shape != (3, 3):
        raise ConfigurationError(f"has no {' and '.join(names)}", where=str(path))
    content = {
        "focal_px": (float(matrix[0, 0]), float(matrix[1, 1])),
        "centre_px": (float(matrix[0, 2]), float(matrix[1, 2])),
        "distortion": tuple(float(value) for value in distortion.ravel()),
        "size_px": _size(found),
    }
    return validate(content, CameraCalibration, where=str(path))


def _matrix(found: Any, name: str) -> Array | None:
    """A matrix of an OpenCV file; None where it has none of this name."""
    try:
        matrix = found[name]
        return np.array(matrix["data"], float).reshape(matrix["rows"], matrix["cols"])
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def _size(found: dict[str, Any]) -> tuple[int, int] | None:
    """The pictures' size in an OpenCV file; None where it does not say."""
    match [found.get(name) for name in ("image_width", "image_height")]:
        case [int(width), int(height)] if min(width, height) > 0:
            return width, height
        case _:
            return None
