"""Views of a board for a lens calibration: their content, whether they add anything, and what is still missing.

A lens is known where corners were seen: in every region of the picture, with the board tilted in every direction (only
perspective separates focal length from distance) and at different distances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from drivers.camera.boards import AnyBoard
from drivers.camera.calibration import CameraCalibration
from drivers.camera.frames import Image
from drivers.camera.opencv import cv2
from drivers.camera.pose.board_pose import board_pose
from drivers.core.contacts import Array

LEAST_CORNERS = 8
_FIRST_FOCAL = 1.1  # of the picture's width, to tell tilts before the lens is known
_TILTED_rad, _FLAT_rad = np.radians(15.0), np.radians(12.0)
_NEAR_TO_FAR = 1.4
_NEWS = 0.12
_LARGEST_BLUR_px = 2.5
_LARGEST_BEND = 0.04  # of the board's diagonal in the picture; lenses of 90 degrees bend it by 0.02
_ROWS, _COLUMNS = ("top", "middle", "bottom"), ("left", "centre", "right")
_TILTS = ("away at the right", "away at the left", "away at the bottom", "away at the top")


@dataclass(frozen=True, eq=False)
class BoardView:
    """A board in one picture.

    Attributes:
        name: of the picture, for people.
        points_m: corners on the board, shape (n, 3).
        pixels: corners in the picture, shape (n, 2).
        size_px: width and height of the picture.
        board_m: the board's larger side.
    """

    name: str
    points_m: Array
    pixels: Array
    size_px: tuple[int, int]
    board_m: float

    @cached_property
    def tilt(self) -> Array:
        """The board's normal in the picture's plane, shape (2,), x right and y down: as long as the tilt's sine."""
        found = board_pose(self.points_m, self.pixels, rough_lens(self.size_px))
        return np.zeros(2) if found is None else np.array(found.camera_T_board.rotation().matrix()[:2, 2])

    @cached_property
    def distance(self) -> float:
        """Distance of the board in units of its larger side."""
        found = board_pose(self.points_m, self.pixels, rough_lens(self.size_px))
        return 1.0 if found is None else float(np.linalg.norm(found.camera_T_board.translation())) / self.board_m

    @property
    def features(self) -> Array:
        """Place, tilt and distance on comparable scales, shape (5,)."""
        return np.concatenate([self.pixels.mean(axis=0) / self.size_px[0], self.tilt, [np.log(self.distance)]])


def rough_lens(size_px: tuple[int, int]) -> CameraCalibration:
    """A typical lens as initial guess."""
    focal, (width, height) = _FIRST_FOCAL * size_px[0], size_px
    return CameraCalibration(focal_px=(focal, focal), centre_px=(width / 2, height / 2), size_px=size_px)


def view_of(name: str, image: Image, board: AnyBoard) -> BoardView | str:
    """The view of a picture, or why it has none."""
    blurs = board.blurs_px(image)
    if not blurs:
        return f"no {board.pattern} is visible"
    if not (measured := [blur for blur in blurs if np.isfinite(blur)]):
        return "no edge of its markers can be measured: too small, hidden in part, or without their white border"
    if (blur := float(np.median(measured))) > _LARGEST_BLUR_px:
        return f"blurred: edges {blur:.1f} px wide, at most {_LARGEST_BLUR_px:g} px are accepted"
    points, pixels = board.match_corners(image)
    if len(points) < min(LEAST_CORNERS, board.point_count):
        return f"only {len(points)} corners of the board are visible, {LEAST_CORNERS} are needed"
    if _bend(points, pixels) > _LARGEST_BEND:
        return "its corners lie elsewhere than the description says: count its columns and rows"
    size = (image.shape[1], image.shape[0])
    return BoardView(name, points, pixels, size, max(board.size_m) * board.scale)


def _bend(points_m: Array, pixels: Array) -> float:
    """How far corners are from any perspective view of the board, as a share of its diagonal in the picture."""
    to_picture, _ = cv2.findHomography(points_m[:, :2], pixels)
    if to_picture is None:
        return float("inf")
    off_px = cv2.perspectiveTransform(points_m[:, None, :2], to_picture)[:, 0] - pixels
    return float(np.sqrt(np.mean(np.sum(off_px**2, axis=1))) / np.linalg.norm(np.ptp(pixels, axis=0)))


def adds_something(view: BoardView, views: Sequence[BoardView]) -> bool:
    """Whether the board's pose differs from all views so far."""
    return all(np.linalg.norm(view.features - other.features) > _NEWS for other in views)


@dataclass(frozen=True)
class Coverage:
    """Coverage of the views.

    Attributes:
        regions: corners in each ninth of the picture, by name.
        tilts: views with the board tilted each way.
        flat: views with the board nearly parallel to the picture.
        distances: nearest and farthest, in sides of the board; zero without views.
    """

    regions: dict[str, int]
    tilts: dict[str, int]
    flat: int
    distances: tuple[float, float]

    @property
    def missing(self) -> tuple[str, ...]:
        """What a person should show next; empty if nothing is missing."""
        wanted = [
            f"the board in the {name} of the picture" for name, count in self.regions.items() if count < LEAST_CORNERS
        ]
        wanted += [f"the board tilted, {name}" for name, count in self.tilts.items() if not count]
        nearest, farthest = self.distances
        if farthest < _NEAR_TO_FAR * nearest or not nearest:
            wanted.append("the board nearer and farther away")
        return tuple(wanted)


def coverage(views: Sequence[BoardView]) -> Coverage:
    """The coverage of the views so far."""
    names = [f"{row} {column}" for row in _ROWS for column in _COLUMNS]
    counts = np.zeros(9, int)
    for view in views:
        ninth = np.clip((3 * view.pixels / view.size_px).astype(int), 0, 2)
        counts += np.bincount(3 * ninth[:, 1] + ninth[:, 0], minlength=9)
    tilts = np.array([view.tilt for view in views]).reshape(-1, 2)
    steep = np.sin(_TILTED_rad)
    ways = (tilts[:, 0] < -steep, tilts[:, 0] > steep, tilts[:, 1] < -steep, tilts[:, 1] > steep)
    distances = [view.distance for view in views] or [0.0]
    return Coverage(
        dict(zip(names, counts.tolist(), strict=True)),
        dict(zip(_TILTS, (int(way.sum()) for way in ways), strict=True)),
        int(np.sum(np.linalg.norm(tilts, axis=1) < np.sin(_FLAT_rad))),
        (min(distances), max(distances)),
    )
