"""An AprilGrid as Kalibr prints it: tags with a black frame of two modules, and a black square at every tag's corner.

Numbers count from the *bottom* left, row by row upwards, and the tags stand half a turn from OpenCV's drawings of the
same codes. Which way they stand is taken from the picture, so that prints of either kind are read.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from drivers.camera.detection import coarse_markers
from drivers.camera.edges import refine_square
from drivers.camera.frames import Image
from drivers.camera.opencv import cv2
from drivers.camera.targets.printed import MarkerPrint
from drivers.core.contacts import Array

_HALF_TURN = 2
_WINDOW_gaps, _SMALLEST_WINDOW_px = 0.5, 2
"""A corner is refined in a window of so many gaps to each side: less misses it, more meets the tag's modules."""
_ROUNDS, _ENOUGH_px = 60, 0.003


class AprilGrid(MarkerPrint):
    """AprilTags in rows and columns, with black squares between their corners.

    Attributes:
        columns, rows: tags across and up.
        side_m: intended side of a tag's black square (Kalibr's ``tagSize``).
        gap_m: between two tags, and the side of the black squares (``tagSpacing`` times ``tagSize``).
        first_number: of the tag at the bottom left.
        border: modules of each tag's black frame: 2 as in Kalibr's prints, 1 in some others'.
    """

    kind: Literal["aprilgrid"] = "aprilgrid"
    dictionary: str = "DICT_APRILTAG_36h11"
    columns: int = Field(default=5, ge=2, le=50)
    rows: int = Field(default=6, ge=2, le=50)
    side_m: float = Field(default=0.026, gt=0.0)
    gap_m: float = Field(default=0.0078, gt=0.0)
    first_number: int = Field(default=0, ge=0)
    border: Literal[1, 2] = 2

    @model_validator(mode="after")
    def _exists(self) -> AprilGrid:
        if self.gap_m >= self.side_m:
            raise ValueError("gap_m is smaller than side_m")
        self._check_numbers(self.numbers[-1])
        return self

    @property
    def border_modules(self) -> int:
        """Width of the black frame of each tag, modules."""
        return self.border

    @property
    def size_m(self) -> tuple[float, float]:
        """Intended width and height with the outer black squares, metres."""
        step = self.side_m + self.gap_m
        return self.columns * step + self.gap_m, self.rows * step + self.gap_m

    @property
    def point_count(self) -> int:
        """Number of corners of a completely visible board."""
        return 4 * self.columns * self.rows

    @property
    def numbers(self) -> range:
        """The numbers of its tags."""
        return range(self.first_number, self.first_number + self.columns * self.rows)

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 if it is not visible."""
        quads = self._quads_px(image)
        if not quads:
            return np.zeros((0, 3)), np.zeros((0, 2))
        points = np.concatenate([self.marker_corners_m(number) for number in quads])
        return _as_they_stand(points, np.array(list(quads.values())))

    def blurs_px(self, image: Image) -> Sequence[float]:
        """Widths of the tags' edges, pixels; infinite where an edge cannot be measured; empty without a tag."""
        return [refine_square(image, quad, self.modules).blur_px for quad in self._quads_px(image).values()]

    def _quads_px(self, image: Image) -> dict[int, Array]:
        """Corners of each tag, shape (4, 2): where black and white squares meet crosswise, which blur does not move."""
        found = {}
        for number, quad in coarse_markers(image, self.dictionary, self.border).items():
            if number in self.numbers:
                gap_px = self.gap_m / self.side_m * float(np.linalg.norm(quad[0] - quad[1]))
                half = max(_SMALLEST_WINDOW_px, round(_WINDOW_gaps * gap_px))
                corners = quad.astype(np.float32).reshape(-1, 1, 2).copy()
                until = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, _ROUNDS, _ENOUGH_px)
                found[number] = cv2.cornerSubPix(image, corners, (half, half), (-1, -1), until)[:, 0].astype(float)
        return found

    def marker_corners_m(self, number: int) -> Array:
        """Corners of a tag, clockwise from the top left as printed, true size, metres, shape (4, 3), board frame."""
        row, column = divmod(number - self.first_number, self.columns)
        step, (width, height) = self.side_m + self.gap_m, self.size_m
        left, bottom = self.gap_m + column * step - width / 2, self.gap_m + row * step - height / 2
        square = self.side_m * np.array([[0.0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 0]])
        return np.asarray(self.scale * (square + np.array([left, bottom, 0.0])))

    def marker_image(self, number: int, side_px: int) -> Image:
        """One of its tags as it is printed, shape (side_px, side_px)."""
        return np.rot90(super().marker_image(number, side_px), _HALF_TURN)

    @property
    def square_corners_m(self) -> Array:
        """Top left corners of the black squares in intended size, metres, shape (n, 2), from the print's, y down."""
        step = self.side_m + self.gap_m
        rows, columns = np.indices((self.rows + 1, self.columns + 1))
        return np.asarray(step * np.stack([columns, rows], axis=-1).reshape(-1, 2))


def _as_they_stand(points_m: Array, quads_px: Array) -> tuple[Array, Array]:
    """Corners (n, 3) with their pixels (n, 2), the tags turned the way in which all of them lie on one plane.

    A single tag does not show that; it is assumed to be oriented as Kalibr prints it.
    """
    turned = [np.roll(quads_px, -turn, axis=1).reshape(-1, 2) for turn in range(4)]
    if len(quads_px) == 1:
        return points_m, turned[_HALF_TURN]
    return points_m, min(turned, key=lambda pixels: _misfit_px(points_m, pixels))


def _misfit_px(points_m: Array, pixels: Array) -> float:
    """Median distance of pixels (n, 2) from where a plane's perspective puts their points (n, 3)."""
    mapping, _ = cv2.findHomography(points_m[:, :2], pixels)
    if mapping is None:
        return float("inf")
    expected = cv2.perspectiveTransform(points_m[None, :, :2].astype(float), mapping)[0]
    return float(np.median(np.linalg.norm(expected - pixels, axis=1)))
