"""A simulated camera without a physics engine. It sees a printed board held in front of it, or the two table markers.

Four rays per pixel are traced through the lens to the board's plane; blur and noise are added last. The result is a
source of pictures in real time, like a real camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from gtsam import Pose3, Rot3

from drivers.camera.boards import AnyBoard, CharucoBoard, GridBoard, SingleMarker
from drivers.camera.calibration import CameraCalibration
from drivers.camera.frames import Image
from drivers.camera.markers import MarkerSettings
from drivers.camera.opencv import cv2
from drivers.camera.pictures import Picture
from drivers.camera.rendering.settings import CameraSettings
from drivers.camera.rendering.table_camera import PrintedMarker, TableCamera
from drivers.camera.source_settings import CameraSourceSettings
from drivers.camera.targets.april_grid import AprilGrid
from drivers.camera.targets.chessboard import Chessboard
from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from drivers.core.poses import transform_points

_RAYS = 2  # rays per pixel and direction
_MARGIN = 0.06  # white border around the board, relative to its width
_TEXELS_PER_m = 12_000
_PICTURES = 5
_GREY, _BLACK, _WHITE = 120.0, 22.0, 232.0
BOARD_VIEWS = 40


@dataclass(frozen=True, eq=False)
class BoardView:
    """Imperfections of a picture of a board: blur (px) and noise (levels of 255)."""

    blur_px: float = 0.7
    noise_levels: float = 2.5


def draw_board(
    board: AnyBoard,
    camera_T_board: Pose3,
    lens: CameraCalibration,
    rng: np.random.Generator,
    view: BoardView | None = None,
) -> Image:
    """Draw a picture of a board of true size, shape (height, width). Raises ConfigurationError if the lens states no
    size.
    """
    if lens.size_px is None:
        raise ConfigurationError("the picture size is missing", where="simulated camera", hint="Set size_px")
    view, texture = view or BoardView(), board_texture(board)
    rays = _rays(lens)
    rotation, place = camera_T_board.rotation().matrix(), np.array(camera_T_board.translation())
    depth = (rotation[:, 2] @ place) / np.maximum(np.abs(rays @ rotation[:, 2]), 1e-9)
    depth *= np.sign(rays @ rotation[:, 2])
    on_board = (rays * depth[..., None] - place) @ rotation[:, :2]
    width_m, height_m = (size * (1 + 2 * _MARGIN) * board.scale for size in board.size_m)
    columns = ((on_board[..., 0] / width_m + 0.5) * texture.shape[1] - 0.5).astype(np.float32)
    rows = ((0.5 - on_board[..., 1] / height_m) * texture.shape[0] - 0.5).astype(np.float32)
    fine = cv2.remap(texture, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=_GREY)
    picture = cv2.resize(np.where(depth > 0, fine, _GREY), lens.size_px, interpolation=cv2.INTER_AREA)
    sharp = cv2.GaussianBlur(picture, (0, 0), view.blur_px)
    noise = view.noise_levels * rng.standard_normal(sharp.shape, dtype=np.float32)
    return np.asarray(np.clip(sharp + noise, 0, 255), np.uint8)


@lru_cache(maxsize=4)
def board_texture(board: AnyBoard) -> Array:
    """The print with its white margin as grey levels, with many texels per module."""
    width_m, height_m = board.size_m
    size = (round(width_m * _TEXELS_PER_m), round(height_m * _TEXELS_PER_m))
    if isinstance(board, Chessboard):
        inner = cv2.resize(np.where(board.is_black, 0, 255).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    elif isinstance(board, CharucoBoard):
        inner = board.opencv_board.generateImage(size, marginSize=0)
    elif isinstance(board, SingleMarker):
        inner = board.marker_image(board.number, size[0])
    else:
        inner = _grid_texture(board, size)
    across, down = round(_MARGIN * size[0]), round(_MARGIN * size[1])
    whole = cv2.copyMakeBorder(inner, down, down, across, across, cv2.BORDER_CONSTANT, value=255)
    return np.where(whole > 127, _WHITE, _BLACK).astype(np.float32)


def _grid_texture(board: GridBoard | AprilGrid, size: tuple[int, int]) -> Image:
    inner = np.full(size[::-1], 255, np.uint8)
    side = round(board.side_m * _TEXELS_PER_m)
    for corner in board.square_corners_m if isinstance(board, AprilGrid) else ():
        column, row = np.rint(_TEXELS_PER_m * corner).astype(int)
        end_column, end_row = np.rint(_TEXELS_PER_m * (corner + board.gap_m)).astype(int)
        inner[row:end_row, column:end_column] = 0
    for number in board.numbers:
        left, top = board.marker_corners_m(number)[0, :2] / board.scale
        column = round((left + board.size_m[0] / 2) * _TEXELS_PER_m)
        row = round((board.size_m[1] / 2 - top) * _TEXELS_PER_m)
        inner[row : row + side, column : column + side] = board.marker_image(number, side)
    return inner


@lru_cache(maxsize=2)
def _rays(lens: CameraCalibration) -> Array:
    """Directions of all rays, shape (rows, columns, 3), camera frame."""
    assert lens.size_px is not None
    width, height = lens.size_px
    steps = [(np.arange(count * _RAYS) + 0.5) / _RAYS - 0.5 for count in (width, height)]
    pixels = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
    return lens.rays(pixels).reshape(height * _RAYS, width * _RAYS, 3)


def board_poses(board: AnyBoard, lens: CameraCalibration, count: int, rng: np.random.Generator) -> list[Pose3]:
    """Poses in which a person would hold the board for a calibration: all over the picture, tilted, near and far."""
    assert lens.size_px is not None
    facing, size_m = Rot3(np.diag([1.0, -1.0, -1.0])), max(board.size_m)
    poses: list[Pose3] = []
    while len(poses) < count:
        tilt, about, turn = rng.uniform(0.0, 0.75), rng.uniform(-np.pi, np.pi), rng.uniform(-0.3, 0.3)
        axis = np.array([np.cos(about), np.sin(about), 0.0])
        depth = size_m * lens.focal_px[0] / lens.size_px[0] * rng.uniform(1.15, 2.4)
        middle = np.array([*rng.uniform(0.2, 0.8, 2)]) * lens.size_px
        place = depth * lens.rays(middle[None])[0]
        pose = Pose3(Rot3.Expmap(tilt * axis) * Rot3.Yaw(turn) * facing, place)
        if _inside(board, pose, lens):
            poses.append(pose)
    return poses


def _inside(board: AnyBoard, camera_T_board: Pose3, lens: CameraCalibration) -> bool:
    half = np.array([*board.size_m, 0.0]) / 2 * board.scale
    corners = half * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    pixels = lens.project(transform_points(camera_T_board, corners))
    assert lens.size_px is not None
    return bool(np.all(pixels > 4.0) and np.all(pixels < np.array(lens.size_px) - 5.0))


def simulated_lens(size_px: tuple[int, int]) -> CameraCalibration:
    """The lens of the simulated camera at a resolution: about 47 degrees wide, some barrel distortion."""
    width, height = size_px
    return CameraCalibration(
        focal_px=(1.15 * width, 1.152 * width),
        centre_px=(0.505 * width, 0.495 * height),
        distortion=(-0.12, 0.06, 0.0008, -0.0006, 0.0),
        size_px=size_px,
    )


class SimulatedSource:
    """``simulated``: the two markers on the table, without end; ``simulated:board``: a ChArUco board held up;
    ``simulated:chessboard`` and ``simulated:aprilgrid``: these.

    Pictures are drawn beforehand, because drawing takes longer than detection, and returned at the camera's rate. The
    board source ends after :data:`BOARD_VIEWS` pictures, which are returned as fast as they can be drawn.
    """

    def __init__(self, settings: CameraSourceSettings, clock: Clock) -> None:
        self._settings, self._clock = settings, clock
        self._rng = np.random.default_rng(0)
        self._counter, self._start_ns = 0, 0
        self._pictures: list[Image] = []
        self._poses: list[Pose3] = []

    def open(self) -> None:
        """Draw the pictures. Raises ConfigurationError for an unknown scene."""
        scene = self._settings.place().name or "table"
        if scene == "table":
            self._pictures = table_pictures(self._settings, _PICTURES, self._rng)
        elif scene in ("board", "chessboard", "aprilgrid"):
            self._poses = board_poses(self._board, self._lens, BOARD_VIEWS, self._rng)
        else:
            hint = "Choose simulated:table, simulated:board, simulated:chessboard or simulated:aprilgrid"
            raise ConfigurationError(f"no scene called {scene!r}", where="simulated camera", hint=hint)
        self._start_ns = self._clock.now_ns()

    def read(self) -> Picture | None:
        """The next picture, when it is due."""
        self._counter += 1
        if self._poses:
            if self._counter > len(self._poses):
                return None
            image = draw_board(self._board, self._poses[self._counter - 1], self._lens, self._rng)
            return Picture(self._clock.now_ns(), self._counter, 0, image)
        due_ns = self._start_ns + round(self._counter * NANOSECONDS / self._settings.rate_hz)
        self._clock.sleep_until_ns(due_ns)
        return Picture(self._clock.now_ns(), self._counter, 0, self._pictures[self._counter % len(self._pictures)])

    def close(self) -> None:
        """Forget the pictures."""
        self._pictures = []

    def notes(self) -> tuple[str, ...]:
        """Nothing to report: all settings are accepted."""
        return ()

    @property
    def _lens(self) -> CameraCalibration:
        return simulated_lens(self._settings.size_px)

    @property
    def _board(self) -> AnyBoard:
        boards: dict[str, AnyBoard] = {"chessboard": Chessboard(), "aprilgrid": AprilGrid()}
        return boards.get(self._settings.place().name, CharucoBoard(dictionary=self._settings.dictionary))


def table_pictures(settings: CameraSourceSettings, count: int, rng: np.random.Generator) -> list[Image]:
    """Pictures of the world marker and of an object's, which turns from one to the next, as seen from under the
    table.
    """
    markers = MarkerSettings(dictionary=settings.dictionary)
    camera = TableCamera(simulated_lens(settings.size_px), CameraSettings(), rng)
    world = PrintedMarker(settings.dictionary, markers.world_id, markers.world_side_m)
    target = PrintedMarker(settings.dictionary, markers.object_id, markers.object_side_m)
    down = Rot3(np.diag([1.0, -1.0, -1.0]))
    beside = Pose3(down, np.array([0.15, 0.0, 0.0]))
    places = [Pose3(Rot3.Yaw(0.5 * n) * down, np.array([-0.03, 0.01 * np.cos(n), 0.0])) for n in range(count)]
    return [camera.render(((world, beside), (target, place)), np.zeros((3, 3))) for place in places]
