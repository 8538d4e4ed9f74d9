"""ArUco markers in a picture: their numbers and corners, found by OpenCV, of the extra ``camera``."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from drivers.camera.edges import refine_square
from drivers.camera.frames import Detection, Image, SeenMarker
from drivers.camera.markers import known_dictionary
from drivers.camera.opencv import cv2
from drivers.core.contacts import Array


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
