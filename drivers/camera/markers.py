"""ArUco markers in a picture: their numbers and corners.

A marker's frame: x to the right and y up on the print, z out of it; corners in OpenCV's order, clockwise from the top
left. Markers on the underside of the table are seen from below: their z points down.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import cv2
import numpy as np
from gtsam import Pose3
from pydantic import Field, field_validator

from drivers.camera.calibration import CameraCalibration
from drivers.camera.edges import refine_square
from drivers.camera.frames import Detection, Image, SeenMarker
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.fingertip import RigidTransform
from drivers.core.poses import transform_points

_DOWN = RigidTransform(translation_m=(0.0, 0.0, 0.0), rpy_rad=(float(np.pi), 0.0, 0.0))


_NAMES = (name for name in dir(cv2.aruco) if name.startswith("DICT_"))
DICTIONARIES: tuple[str, ...] = tuple(sorted(_NAMES, key=lambda name: int(getattr(cv2.aruco, name))))
"""Names of OpenCV's dictionaries in the order of their numbers."""


class MarkerSettings(StrictModel):
    """The two markers of the rig.

    Attributes:
        dictionary: OpenCV's name of the dictionary.
        world_id, world_side_m: the marker fixed to the table, and the intended side of its black square.
        object_id, object_side_m: the same for the marker under the object.
        print_scale: measured length of the print's check bar divided by its nominal length.
        world_T_worldmarker: its pose in the world; z down.
        object_T_objectmarker: pose of the object's marker in the object's frame; z down while the object stands on the
            table.
        corner_sigma_px: error of a detected corner, per axis.
        glass_thickness_m, glass_index: the table's glass plate between camera and markers.
        table_sigma_m, table_sigma_rad: error that even a sharp picture leaves, because markers are glued on by hand.
        freedom: ``planar``: the object is assumed to stand on the table; ``spatial``: it may have any pose, and
            pictures that allow two poses are refused.
        ambiguous_sigmas: required confidence in the choice between a single marker's two poses, in standard deviations
            of the corners' noise.
        moved_px: distance from its mean at which the world marker counts as moved.
        world_marker_fixed: the world marker cannot move (it is part of the table). If it seems to move, the camera has
            moved, and a new mean is started. Otherwise the ground truth ends there, since it is unknown which of the
            two was bumped.
        largest_blur_px: wider edges mean that the picture is not sharp, or that something moved.
        largest_misfit_m: a larger misfit of the object's square on the table means that the object is lifted or tilted.
    """

    dictionary: str = "DICT_4X4_50"
    world_id: int = Field(default=0, ge=0)
    world_side_m: float = Field(default=0.050, gt=0.0)
    object_id: int = Field(default=7, ge=0)
    object_side_m: float = Field(default=0.035, gt=0.0)
    print_scale: float = Field(default=1.0, ge=0.995, le=1.005)
    world_T_worldmarker: RigidTransform = _DOWN
    object_T_objectmarker: RigidTransform = _DOWN
    corner_sigma_px: float = Field(default=0.1, gt=0.0)
    glass_thickness_m: float = Field(default=0.0, ge=0.0)
    glass_index: float = Field(default=1.5, ge=1.0)
    table_sigma_m: float = Field(default=0.0003, ge=0.0)
    table_sigma_rad: float = Field(default=0.001, ge=0.0)
    freedom: Literal["planar", "spatial"] = "planar"
    ambiguous_sigmas: float = Field(default=5.0, gt=0.0)
    moved_px: float = Field(default=1.0, gt=0.0)
    world_marker_fixed: bool = False
    largest_blur_px: float = Field(default=1.6, gt=0.0)
    largest_misfit_m: float = Field(default=0.001, gt=0.0)

    @field_validator("dictionary")
    @classmethod
    def _known(cls, value: str) -> str:
        return known_dictionary(value)

    @property
    def world_corners_m(self) -> Array:
        """The world marker's corners in its own frame, true size, shape (4, 3)."""
        return marker_corners(self.world_side_m * self.print_scale)

    @property
    def object_corners_m(self) -> Array:
        """The object marker's corners in its own frame, true size, shape (4, 3)."""
        return marker_corners(self.object_side_m * self.print_scale)


def known_dictionary(name: str) -> str:
    """The name, if OpenCV has a dictionary of this name. Raises ValueError otherwise."""
    if name not in DICTIONARIES:
        raise ValueError(f"{name!r} is not an OpenCV dictionary")
    return name


def dictionary_or_file(name: str) -> str:
    """The name of one of OpenCV's dictionaries or of a file that holds one. Raises ValueError."""
    if name.endswith((".yml", ".yaml")):
        opencv_dictionary(name)
        return name
    return known_dictionary(name)


@lru_cache(maxsize=16)
def opencv_dictionary(name: str) -> Any:
    """A dictionary by its name, or from a file in OpenCV's format. Raises ValueError for a file without a
    dictionary.
    """
    if not name.endswith((".yml", ".yaml")):
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    dictionary = cv2.aruco.Dictionary()
    try:
        storage = cv2.FileStorage(name, cv2.FILE_STORAGE_READ)
        good = storage.isOpened() and dictionary.readDictionary(storage.root())
    except (cv2.error, SystemError) as error:
        raise ValueError(f"{name!r} contains no dictionary in OpenCV's format") from error
    if not good:
        raise ValueError(f"{name!r} contains no dictionary in OpenCV's format")
    return dictionary


@dataclass(frozen=True)
class MarkerPose:
    """One of the two poses that a square's four corners allow.

    Attributes:
        camera_T_marker: the pose.
        reprojection_px: root mean square distance of the projected corners from the seen ones.
    """

    camera_T_marker: Pose3
    reprojection_px: float


@lru_cache(maxsize=8)
def _detector(dictionary: str, border_modules: int) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border_modules
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.ArucoDetector(opencv_dictionary(dictionary), parameters)


def seen_markers(image: Image, dictionary: str, border_modules: int = 1) -> dict[int, SeenMarker]:
    """Markers in a picture by number, with their blur and with corners accurate to a few hundredths of a pixel.

    A number that is seen more than once is left out, since the right one cannot be known. ``border_modules`` is the
    width of the markers' black frame: 1, or 2 in AprilGrids.
    """
    modules = opencv_dictionary(dictionary).markerSize + 2 * border_modules
    found = coarse_markers(image, dictionary, border_modules)
    return {number: refine_square(image, corners, modules) for number, corners in found.items()}


def detect(image: Image, dictionary: str) -> dict[int, Array]:
    """Only the corners of :func:`seen_markers`, shape (4, 2) each, pixels."""
    return {number: marker.corners_px for number, marker in seen_markers(image, dictionary).items()}


def coarse_markers(image: Image, dictionary: str, border_modules: int = 1) -> dict[int, Array]:
    """As :func:`detect`, with corners refined by OpenCV: accurate to about a quarter of a pixel."""
    corners, numbers, _ = _detector(dictionary, border_modules).detectMarkers(image)
    found = [] if numbers is None else [int(number) for number in np.ravel(numbers)]
    quads = [np.asarray(quad, float).reshape(4, 2) for quad in corners]
    return {number: quad for number, quad in zip(found, quads, strict=True) if found.count(number) == 1}


def detection(image: Image, dictionary: str) -> Detection:
    """All markers in a picture, with their blur."""
    return Detection(dictionary, (image.shape[1], image.shape[0]), seen_markers(image, dictionary))


def other_dictionary(image: Image, dictionary: str) -> str | None:
    """Another dictionary of which the picture shows at least two markers; None if there is none."""
    sizes = ("4X4", "5X5", "6X6", "7X7")
    candidates = [f"DICT_{size}_1000" for size in sizes] + ["DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_36h11"]
    counts = {
        name: len(coarse_markers(image, name)) for name in candidates if name.rpartition("_")[0] not in dictionary
    }
    best = max(counts, key=counts.__getitem__)
    return best if counts[best] >= 2 else None


def marker_corners(side_m: float) -> Array:
    """Corners in the marker's frame, shape (4, 3), metres."""
    return side_m / 2 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])


def marker_poses(corners_px: Array, side_m: float, camera: CameraCalibration) -> tuple[MarkerPose, ...]:
    """Both poses of a single square (IPPE), the better one first; the second is nearly the mirror image of the first.

    For distant, small or nearly face-on squares both have almost the same error.
    """
    _, rotations, translations, _ = cv2.solvePnPGeneric(
        marker_corners(side_m),
        np.asarray(corners_px, float),
        camera.matrix,
        camera.distortion_coefficients,
        flags=cv2.SOLVEPNP_IPPE_SQUARE,
    )
    poses = [_pose(r, t) for r, t in zip(rotations, translations, strict=True)]
    return tuple(
        sorted(
            (MarkerPose(pose, reprojection_px(pose, corners_px, side_m, camera)) for pose in poses),
            key=lambda found: found.reprojection_px,
        )
    )


def refine_pose(camera_T_points: Pose3, points_m: Array, pixels: Array, camera: CameraCalibration) -> Pose3:
    """The pose near an initial guess that minimizes the distances of points (n, 3) to their pixels (n, 2)."""
    rotation, translation = cv2.solvePnPRefineLM(
        np.asarray(points_m, float),
        np.asarray(pixels, float),
        camera.matrix,
        camera.distortion_coefficients,
        cv2.Rodrigues(camera_T_points.rotation().matrix())[0],
        np.array(camera_T_points.translation()).reshape(3, 1),
    )
    return _pose(rotation, translation)


def reprojection_px(camera_T_marker: Pose3, corners_px: Array, side_m: float, camera: CameraCalibration) -> float:
    """Root mean square distance between the projected and the seen corners, pixels."""
    return points_reprojection_px(camera_T_marker, marker_corners(side_m), corners_px, camera)


def points_reprojection_px(camera_T_points: Pose3, points_m: Array, pixels: Array, camera: CameraCalibration) -> float:
    """Root mean square distance between projected points (n, 3) and pixels (n, 2)."""
    projected = camera.project(transform_points(camera_T_points, points_m))
    return float(np.sqrt(np.mean(np.sum((projected - pixels) ** 2, axis=1))))


def _pose(rotation_vector: Any, translation: Any) -> Pose3:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = cv2.Rodrigues(rotation_vector)[0], np.ravel(translation)
    return Pose3(matrix)
