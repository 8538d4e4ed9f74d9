"""What all prints have in common: a check bar that shows their true size, and what a picture of one shows."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import field_validator

from drivers.camera.detection import dictionary_or_file, opencv_dictionary, seen_markers
from drivers.camera.frames import Image
from drivers.camera.markers import MARKER_COUNTS
from drivers.camera.opencv import cv2
from drivers.core.configuration import StrictModel

CHECK_BAR_mm, LARGEST_SCALE_ERROR = 100.0, 0.005


class Printed(StrictModel):
    """Properties common to all prints.

    Attributes:
        measured_bar_mm: length of the print's check bar, measured with a ruler or caliper; it should be 100 mm. None if
            it was not measured.
    """

    measured_bar_mm: float | None = None

    @field_validator("measured_bar_mm")
    @classmethod
    def _true_to_scale(cls, value: float | None) -> float | None:
        if value is not None and abs(value / CHECK_BAR_mm - 1.0) > LARGEST_SCALE_ERROR:
            share = 100.0 * (value / CHECK_BAR_mm - 1.0)
            problem = (
                f"the {CHECK_BAR_mm:g} mm check bar measures {value:g} mm: {share:+.1f} %, at most 0.5 % are allowed"
            )
            raise ValueError(f"{problem}. Print at 100 % (actual size), without fitting to the page")
        return value

    @property
    def scale(self) -> float:
        """True size divided by intended size; 1 if the bar was not measured."""
        return (self.measured_bar_mm or CHECK_BAR_mm) / CHECK_BAR_mm


class MarkerPrint(Printed):
    """A print with markers.

    Attributes:
        dictionary: OpenCV's name of the dictionary of its markers, or a file with one in OpenCV's form.
    """

    dictionary: str = "DICT_4X4_50"

    @field_validator("dictionary")
    @classmethod
    def _known(cls, value: str) -> str:
        return dictionary_or_file(value)

    @property
    def pattern(self) -> str:
        """What a picture has to show, for people."""
        return f"marker of {self.dictionary}"

    @property
    def border_modules(self) -> int:
        """Width of the black frame of each marker, modules."""
        return 1

    @property
    def modules(self) -> int:
        """Number of modules across a marker, with its black frame."""
        return int(self.opencv_dictionary.markerSize) + 2 * self.border_modules

    def blurs_px(self, image: Image) -> Sequence[float]:
        """Widths of the markers' edges, pixels; infinite where an edge cannot be measured; empty without a marker."""
        return [marker.blur_px for marker in seen_markers(image, self.dictionary, self.border_modules).values()]

    def marker_image(self, number: int, side_px: int) -> Image:
        """One of its markers as it is printed, shape (side_px, side_px)."""
        border = self.border_modules
        drawn = cv2.aruco.generateImageMarker(self.opencv_dictionary, number, side_px, borderBits=border)
        return np.asarray(drawn, np.uint8)

    @cached_property
    def opencv_dictionary(self) -> Any:
        """The OpenCV dictionary object."""
        return opencv_dictionary(self.dictionary)

    def _check_numbers(self, largest: int) -> None:
        count = MARKER_COUNTS.get(self.dictionary) or len(self.opencv_dictionary.bytesList)
        if largest >= count:
            raise ValueError(f"{self.dictionary} has markers 0 to {count - 1}, not {largest}")
