"""Printed boards: single markers, grids of markers and ChArUco boards, and their corners in a picture.

All boards, those in :mod:`drivers.camera.targets` too, share one frame: x to the right and y up on the print, z out of
it, origin in the print's *middle*. The origin of OpenCV's boards is their top left corner, with y down;
this module alone converts between the frames.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, RootModel, model_validator

from drivers.camera.detection import detect
from drivers.camera.frames import Image
from drivers.camera.opencv import cv2
from drivers.camera.targets.april_grid import AprilGrid
from drivers.camera.targets.chessboard import Chessboard
from drivers.camera.targets.kalibr_target import board_of_kalibr
from drivers.camera.targets.printed import MarkerPrint
from drivers.core.configuration import load, validate
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError


class SingleMarker(MarkerPrint):
    """One marker; ``side_m`` is the intended side length of its black square."""

    kind: Literal["single"] = "single"
    number: int = Field(default=0, ge=0)
    side_m: float = Field(default=0.05, gt=0.0)

    @model_validator(mode="after")
    def _exists(self) -> SingleMarker:
        self._check_numbers(self.number)
        return self

    @property
    def size_m(self) -> tuple[float, float]:
        """Intended width and height of the black square, metres."""
        return self.side_m, self.side_m

    @property
    def point_count(self) -> int:
        """Number of corners of a completely visible board."""
        return 4

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 if it is not visible."""
        found = detect(image, self.dictionary)
        if self.number not in found:
            return np.zeros((0, 3)), np.zeros((0, 2))
        half = self.side_m * self.scale / 2
        corners = half * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
        return corners, found[self.number]


class GridBoard(MarkerPrint):
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
        """Intended width and height from the first marker to the last, metres."""
        step = self.side_m + self.gap_m
        return self.columns * step - self.gap_m, self.rows * step - self.gap_m

    @property
    def point_count(self) -> int:
        """Number of corners of a completely visible board."""
        return 4 * self.columns * self.rows

    @property
    def numbers(self) -> range:
        """The numbers of its markers."""
        return range(self.first_number, self.first_number + self.columns * self.rows)

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 if it is not visible."""
        found = {number: quad for number, quad in detect(image, self.dictionary).items() if number in self.numbers}
        points = [self.marker_corners_m(number) for number in found]
        return np.concatenate([np.zeros((0, 3)), *points]), np.concatenate([np.zeros((0, 2)), *found.values()])

    def marker_corners_m(self, number: int) -> Array:
        """Corners of one of its markers in true size, metres, shape (4, 3), board frame."""
        row, column = divmod(number - self.first_number, self.columns)
        step, (width, height) = self.side_m + self.gap_m, self.size_m
        left, top = column * step - width / 2, height / 2 - row * step
        square = self.side_m * np.array([[0.0, 0, 0], [1, 0, 0], [1, -1, 0], [0, -1, 0]])
        return np.asarray(self.scale * (square + np.array([left, top, 0.0])))


class CharucoBoard(MarkerPrint):
    """A chessboard with markers in its white squares; the corners between squares are measured.

    Attributes:
        columns, rows: squares across and down.
        square_m, marker_m: intended sides of a square and of a marker's black square.
        legacy: rows are numbered as in OpenCV before 4.6 (for old prints with an even number of rows).
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
        """Intended width and height of the chessboard, metres."""
        return self.columns * self.square_m, self.rows * self.square_m

    @property
    def point_count(self) -> int:
        """Number of corners of a completely visible board."""
        return (self.columns - 1) * (self.rows - 1)

    @cached_property
    def opencv_board(self) -> Any:
        """OpenCV's board, in its own frame: origin at the top left, y down."""
        size = (self.columns, self.rows)
        board = cv2.aruco.CharucoBoard(size, self.square_m, self.marker_m, self.opencv_dictionary)
        board.setLegacyPattern(self.legacy)
        return board

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 if it is not visible."""
        corners, numbers, _, _ = self._detector.detectBoard(image)
        if numbers is None or not len(numbers):
            return np.zeros((0, 3)), np.zeros((0, 2))
        points = self.corners_m[np.ravel(numbers)]
        return points, np.asarray(corners, float).reshape(-1, 2)

    @property
    def corners_m(self) -> Array:
        """Inner corners of the chessboard in OpenCV's order, true size, metres, shape (n, 3), board frame."""
        width, height = self.size_m
        from_top_left = np.asarray(self.opencv_board.getChessboardCorners(), float)
        middle = from_top_left * [1.0, -1.0, 1.0] + [-width / 2, height / 2, 0.0]
        return np.asarray(self.scale * middle)

    @cached_property
    def _detector(self) -> Any:
        return cv2.aruco.CharucoDetector(self.opencv_board)


AnyBoard: TypeAlias = SingleMarker | GridBoard | CharucoBoard | AprilGrid | Chessboard
Board: TypeAlias = Annotated[AnyBoard, Field(discriminator="kind")]


class _BoardFile(RootModel[Board]):
    """A board as stored in a file; its ``kind`` says which of the five it is."""


def load_board(path: Path) -> AnyBoard:
    """Read a board's description, written by ``tactile-lab markers`` or for Kalibr. Raises ConfigurationError."""
    content = load(path)
    if not isinstance(content, dict):
        raise ConfigurationError(
            "is not a description of a board", where=str(path), hint="Create one with: tactile-lab markers"
        )
    if "target_type" in content:
        content = board_of_kalibr(content, str(path))
    return validate(content, _BoardFile, where=str(path)).root
