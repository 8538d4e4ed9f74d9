"""The camera's lens: from our own YAML files, or from the files of OpenCV's calibration programs."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from pydantic import Field, field_validator

from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import open_plain

_DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
_UNDISTORTION = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 40, 1e-9)
"""OpenCV's default of five iterations leaves an error of half a pixel at the edge of a wide picture."""


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
        points = cv2.undistortPointsIter(
            np.asarray(pixels, float).reshape(-1, 1, 2),
            self.matrix,
            self.distortion_coefficients,
            np.eye(3),
            np.eye(3),
            _UNDISTORTION,
        )
        return np.hstack([np.asarray(points, float)[:, 0], np.ones((len(points), 1))])

    def project(self, points_camera_m: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in the camera frame."""
        pixels, _ = cv2.projectPoints(
            points_camera_m, np.zeros(3), np.zeros(3), self.matrix, self.distortion_coefficients
        )
        return np.asarray(pixels[:, 0], float)

    def projection(self, points_camera_m: Array) -> tuple[Array, Array]:
        """Pixels (n, 2) of points (n, 3) in the camera frame, and their derivatives with respect to the points (n, 2,
        3).
        """
        pixels, slopes = cv2.projectPoints(
            points_camera_m, np.zeros(3), np.zeros(3), self.matrix, self.distortion_coefficients
        )
        return np.asarray(pixels[:, 0], float), np.asarray(slopes, float)[:, 3:6].reshape(-1, 2, 3)


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
            return file.read(9) == b"%YAML:1.0"
    except OSError as error:
        raise ConfigurationError(f"cannot be read ({error.strerror})", where=str(path)) from error


def _opencv(path: Path) -> CameraCalibration:
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        matrix, distortion = storage.getNode("camera_matrix").mat(), storage.getNode("distortion_coefficients").mat()
        size = [int(storage.getNode(name).real()) for name in ("image_width", "image_height")]
    except (cv2.error, SystemError) as error:
        raise ConfigurationError("is not an OpenCV file", where=str(path)) from error
    if matrix is None or distortion is None or matrix.shape != (3, 3):
        raise ConfigurationError("has no camera_matrix and distortion_coefficients", where=str(path))
    content = {
        "focal_px": (float(matrix[0, 0]), float(matrix[1, 1])),
        "centre_px": (float(matrix[0, 2]), float(matrix[1, 2])),
        "distortion": tuple(float(value) for value in distortion.ravel()),
        "size_px": tuple(size) if min(size) > 0 else None,
    }
    return validate(content, CameraCalibration, where=str(path))
