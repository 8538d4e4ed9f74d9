"""Printed boards: single markers, grids of markers, ChArUco boards; their corners in a picture, and the board's pose.

All three share one frame: x to the right and y up on the print, z out of it, origin in the print's *middle*. OpenCV's
own boards begin at their top left corner with y down; what it gives is turned into this frame in one place, here.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import cv2
import numpy as np
from pydantic import Field, RootModel, field_validator, model_validator

from drivers.camera.frames import Image
from drivers.camera.markers import detect, dictionary_or_file, opencv_dictionary
from drivers.core.configuration import StrictModel, load, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError

CHECK_BAR_mm, LARGEST_SCALE_ERROR = 100.0, 0.005


class Printed(StrictModel):
    """What every print has.

    Attributes:
        dictionary: OpenCV's name of the dictionary of its markers, or a file with one in OpenCV's form.
        measured_bar_mm: length of the print's check bar, measured with a ruler or caliper; it should be 100 mm. None
            while nobody has measured.
    """

    dictionary: str = "DICT_4X4_50"
    measured_bar_mm: float | None = None

    @field_validator("dictionary")
    @classmethod
    def _known(cls, value: str) -> str:
        return dictionary_or_file(value)

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
        """True size over intended size; 1 while the bar was not measured."""
        return (self.measured_bar_mm or CHECK_BAR_mm) / CHECK_BAR_mm

    @cached_property
    def opencv_dictionary(self) -> Any:
        """The dictionary itself."""
        return opencv_dictionary(self.dictionary)

    def _check_numbers(self, largest: int) -> None:
        count = len(self.opencv_dictionary.bytesList)
        if largest >= count:
            raise ValueError(f"{self.dictionary} has markers 0 to {count - 1}, not {largest}")


class SingleMarker(Printed):
    """One marker; ``side_m`` is that of its black square as meant to be printed."""

    kind: Literal["single"] = "single"
    number: int = Field(default=0, ge=0)
    side_m: float = Field(default=0.05, gt=0.0)

    @model_validator(mode="after")
    def _exists(self) -> SingleMarker:
        self._check_numbers(self.number)
        return self

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of the black square, as meant."""
        return self.side_m, self.side_m

    @property
    def point_count(self) -> int:
        """Corners of a board that is seen whole."""
        return 4

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 where it is not seen."""
        found = detect(image, self.dictionary)
        if self.number not in found:
            return np.zeros((0, 3)), np.zeros((0, 2))
        half = self.side_m * self.scale / 2
        corners = half * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
        return corners, found[self.number]


class GridBoard(Printed):
    """Markers in rows and columns with gaps between, numbered row by row from ``first_number``."""

    kind: Literal["grid"] = "grid"
    columns: int = Field(default=5, ge=1, le=50)
    rows: int = Field(default=7, ge=1, le=50)
    side_m: float = Field(default=0.027, gt=0.0)
    gap_m: float = Field(default=0.0065, gt=0.0)
    first_number: int = Field(default=0, ge=0)

    @model_validator(mode="after")
    def _exists(self) -> GridBoard:
        self._check_numbers(self.first_number + self.columns * self.rows - 1)
        return self

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height from the first marker to the last, as meant."""
        step = self.side_m + self.gap_m
        return self.columns * step - self.gap_m, self.rows * step - self.gap_m

    @property
    def point_count(self) -> int:
        """Corners of a board that is seen whole."""
        return 4 * self.columns * self.rows

    @property
    def numbers(self) -> range:
        """Its markers."""
        return range(self.first_number, self.first_number + self.columns * self.rows)

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 where it is not seen."""
        found = {number: quad for number, quad in detect(image, self.dictionary).items() if number in self.numbers}
        points = [self.marker_corners_m(number) for number in found]
        return np.concatenate([np.zeros((0, 3)), *points]), np.concatenate([np.zeros((0, 2)), *found.values()])

    def marker_corners_m(self, number: int) -> Array:
        """Corners of one of its markers, true size, shape (4, 3), board frame."""
        row, column = divmod(number - self.first_number, self.columns)
        step, (width, height) = self.side_m + self.gap_m, self.size_m
        left, top = column * step - width / 2, height / 2 - row * step
        square = self.side_m * np.array([[0.0, 0, 0], [1, 0, 0], [1, -1, 0], [0, -1, 0]])
        return np.asarray(self.scale * (square + np.array([left, top, 0.0])))


class CharucoBoard(Printed):
    """A chessboard with markers in its white squares; the corners between squares are what is measured.

    Attributes:
        columns, rows: squares across and down.
        square_m, marker_m: sides of a square and of a marker's black square, as meant.
        legacy: rows are counted as OpenCV did before 4.6 (old prints with an even number of rows).
    """

    kind: Literal["charuco"] = "charuco"
    columns: int = Field(default=7, ge=2, le=50)
    rows: int = Field(default=5, ge=2, le=50)
    square_m: float = Field(default=0.028, gt=0.0)
    marker_m: float = Field(default=0.021, gt=0.0)
    legacy: bool = False

    @model_validator(mode="after")
    def _exists(self) -> CharucoBoard:
        if self.marker_m >= self.square_m:
            raise ValueError("marker_m is smaller than square_m")
        self._check_numbers(self.columns * self.rows // 2 - 1)
        return self

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of the chessboard, as meant."""
        return self.columns * self.square_m, self.rows * self.square_m

    @property
    def point_count(self) -> int:
        """Corners of a board that is seen whole."""
        return (self.columns - 1) * (self.rows - 1)

    @cached_property
    def opencv_board(self) -> Any:
        """OpenCV's board, in its own frame: origin at the top left, y down."""
        size = (self.columns, self.rows)
        board = cv2.aruco.CharucoBoard(size, self.square_m, self.marker_m, self.opencv_dictionary)
        board.setLegacyPattern(self.legacy)
        return board

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 where it is not seen."""
        corners, numbers, _, _ = self._detector.detectBoard(image)
        if numbers is None or not len(numbers):
            return np.zeros((0, 3)), np.zeros((0, 2))
        points = self.corners_m[np.ravel(numbers)]
        return points, np.asarray(corners, float).reshape(-1, 2)

    @property
    def corners_m(self) -> Array:
        """Inner corners of the chessboard in OpenCV's order, true size, shape (n, 3), board frame."""
        width, height = self.size_m
        from_top_left = np.asarray(self.opencv_board.getChessboardCorners(), float)
        middle = from_top_left * [1.0, -1.0, 1.0] + [-width / 2, height / 2, 0.0]
        return np.asarray(self.scale * middle)

    @cached_property
    def _detector(self) -> Any:
        return cv2.aruco.CharucoDetector(self.opencv_board)


AnyBoard: TypeAlias = SingleMarker | GridBoard | CharucoBoard
Board: TypeAlias = Annotated[AnyBoard, Field(discriminator="kind")]


class _BoardFile(RootModel[Board]):
    """A board in a file: its ``kind`` says which of the three."""


def load_board(path: Path) -> AnyBoard:
    """Read a board's description as ``tactile-lab markers`` wrote it. Raises ConfigurationError."""
    content = load(path)
    if not isinstance(content, dict):
        raise ConfigurationError(
            "is not a description of a board", where=str(path), hint="Create one with: tactile-lab markers"
        )
    return validate(content, _BoardFile, where=str(path)).root
