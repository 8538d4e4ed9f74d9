"""A chessboard as a target for lenses: the corners between its squares, found only where all of it is visible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field

from drivers.camera.frames import Image
from drivers.camera.opencv import cv2
from drivers.camera.targets.printed import Printed
from drivers.core.contacts import Array

_RISE_sigmas = 2.563
"""OpenCV measures an edge from a tenth to nine tenths of its height: this many sigmas of a Gaussian blur."""


class Chessboard(Printed):
    """Black and white squares without markers.

    Its orientation is ambiguous by half a turn. A lens does not mind: after half a turn its corners fall on each
    other. On the hand it cannot be used.

    Attributes:
        columns, rows: squares across and down; one fewer corners.
        square_m: intended side of a square.
    """

    kind: Literal["chessboard"] = "chessboard"
    columns: int = Field(default=9, ge=4, le=50)
    rows: int = Field(default=6, ge=4, le=50)
    square_m: float = Field(default=0.02, gt=0.0)

    @property
    def pattern(self) -> str:
        """What a picture has to show, for people."""
        return f"whole chessboard of {self.columns} x {self.rows} squares"

    @property
    def size_m(self) -> tuple[float, float]:
        """Intended width and height, metres."""
        return self.columns * self.square_m, self.rows * self.square_m

    @property
    def point_count(self) -> int:
        """Number of corners of the board."""
        return (self.columns - 1) * (self.rows - 1)

    @property
    def is_black(self) -> Array:
        """Which squares are black, shape (rows, columns); the one at the top left is."""
        return np.asarray((np.indices((self.rows, self.columns)).sum(axis=0) % 2) == 0)

    @property
    def corners_m(self) -> Array:
        """Inner corners row by row from the top left, true size, metres, shape (n, 3), board frame."""
        across = np.arange(1, self.columns) - self.columns / 2
        down = self.rows / 2 - np.arange(1, self.rows)
        x, y = np.meshgrid(across, down)
        corners = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
        return np.asarray(self.scale * self.square_m * corners)

    def match_corners(self, image: Image) -> tuple[Array, Array]:
        """Corners on the board (n, 3), metres, and in the picture (n, 2), pixels; n = 0 if it is not all visible."""
        pixels = self._found(image)
        if pixels is None:
            return np.zeros((0, 3)), np.zeros((0, 2))
        grid = pixels.reshape(self.rows - 1, self.columns - 1, 2)
        across, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
        if across[0] * down[1] < across[1] * down[0]:  # rows counted from the bottom: a mirror image
            grid = grid[::-1]
        return self.corners_m, grid.reshape(-1, 2)

    def blurs_px(self, image: Image) -> Sequence[float]:
        """Mean width of the edges between squares, pixels; empty if the board is not all visible."""
        pixels = self._found(image)
        if pixels is None:
            return []
        size = (self.columns - 1, self.rows - 1)
        sharpness, _ = cv2.estimateChessboardSharpness(image, size, pixels.astype(np.float32)[:, None])
        return [float(np.ravel(sharpness)[0]) / _RISE_sigmas]

    def _found(self, image: Image) -> Array | None:
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        found, pixels = cv2.findChessboardCornersSB(image, (self.columns - 1, self.rows - 1), flags=flags)
        return np.asarray(pixels, float).reshape(-1, 2) if found else None
