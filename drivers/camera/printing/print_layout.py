"""The layout of a sheet of markers in millimetres: black areas, thin lines and text, independent of the file format.

On a sheet x points right and y down, from the top left corner of the paper. Black modules that touch form one area with
one outline, so that no viewer shows hairlines between them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drivers.camera.boards import AnyBoard, CharucoBoard, GridBoard, SingleMarker
from drivers.camera.targets.april_grid import AprilGrid
from drivers.camera.targets.chessboard import Chessboard
from drivers.camera.targets.printed import CHECK_BAR_mm, MarkerPrint
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError

PAPERS_mm = {"A4": (210.0, 297.0), "A3": (297.0, 420.0), "A2": (420.0, 594.0), "letter": (215.9, 279.4)}
_MARGIN_mm, _FOOT_mm, _BETWEEN_mm = 10.0, 30.0, 12.0
_WORDS_mm = 3.2
WHITE_MODULES = 0.5
"""White border around a marker's black square: on a dark table or object the marker is not found without it."""


@dataclass(frozen=True, eq=False)
class Area:
    """A black area: closed outlines, each shape (n, 2), millimetres; a point inside an odd number of them is black."""

    outlines: tuple[Array, ...]


@dataclass(frozen=True)
class Line:
    """A line parallel to an edge of the paper, from one point to another, millimetres; grey lines are for cutting."""

    start: tuple[float, float]
    end: tuple[float, float]
    width_mm: float = 0.2
    grey: bool = False

    @property
    def area_mm(self) -> tuple[float, float, float, float]:
        """The rectangle that it covers, without rounded ends: left, top, width and height, millimetres."""
        (left, right), (top, bottom) = (sorted(ends) for ends in zip(self.start, self.end, strict=True))
        half = self.width_mm / 2
        if left == right:
            return left - half, top, self.width_mm, bottom - top
        return left, top - half, right - left, self.width_mm


@dataclass(frozen=True)
class Words:
    """Text that starts at a point on its base line, millimetres."""

    place: tuple[float, float]
    text: str
    height_mm: float = _WORDS_mm


@dataclass(frozen=True, eq=False)
class Sheet:
    """A sheet of paper: width and height in millimetres, and what is on it."""

    size_mm: tuple[float, float]
    areas: tuple[Area, ...]
    lines: tuple[Line, ...]
    words: tuple[Words, ...]


@dataclass(frozen=True, eq=False)
class _Piece:
    """One print to place on a sheet: its size including its white border, and how to draw it from its top left
    corner.
    """

    width_mm: float
    height_mm: float
    border_mm: float
    areas: tuple[Area, ...]
    title: str


def sheet_of(prints: Sequence[AnyBoard], paper: str = "A4", places: Sequence[str] = ()) -> Sheet:
    """A sheet with the prints below or next to each other, their names, and a check bar.

    Args:
        prints: what to print.
        paper: its format.
        places: where to glue each of them, for the captions; empty if that is up to the user.

    Raises:
        ConfigurationError: the paper format is unknown, or the prints do not fit on it.
    """
    if paper not in PAPERS_mm:
        hint = f"Choose one of {', '.join(PAPERS_mm)}"
        raise ConfigurationError(f"no paper called {paper!r}", where="markers", hint=hint)
    pieces = [_piece(each) for each in prints]
    if places:
        pieces = [replace(piece, title=f"{piece.title}  {at}") for piece, at in zip(pieces, places, strict=True)]
    portrait = PAPERS_mm[paper]
    for size in (portrait, portrait[::-1]):
        if (corners := _places(pieces, size)) is not None:
            return _sheet(pieces, corners, size)
    widest, highest = max(piece.width_mm for piece in pieces), max(piece.height_mm for piece in pieces)
    room = f"{portrait[0] - 2 * _MARGIN_mm:.0f} x {portrait[1] - 2 * _MARGIN_mm - _FOOT_mm:.0f} mm"
    raise ConfigurationError(
        f"{len(pieces)} prints of up to {widest:.0f} x {highest:.0f} mm do not fit on {paper}, which has "
        f"room for {room}",
        where="markers",
        hint="Choose a larger paper or a smaller side, or print fewer at a time",
    )


def _places(pieces: Sequence[_Piece], size: tuple[float, float]) -> list[tuple[float, float]] | None:
    """Top left corners, row by row from left to right; None if there is not enough room."""
    right, bottom = size[0] - _MARGIN_mm, size[1] - _MARGIN_mm - _FOOT_mm
    x = y = _MARGIN_mm
    line_mm, places = 0.0, []
    for piece in pieces:
        if x > _MARGIN_mm and x + piece.width_mm > right:
            x, y, line_mm = _MARGIN_mm, y + line_mm + _BETWEEN_mm, 0.0
        if x + piece.width_mm > right or y + piece.height_mm + 2 * _WORDS_mm > bottom:
            return None
        places.append((x, y))
        x, line_mm = x + piece.width_mm + _BETWEEN_mm, max(line_mm, piece.height_mm)
    return places


def _sheet(pieces: Sequence[_Piece], places: Sequence[tuple[float, float]], size: tuple[float, float]) -> Sheet:
    areas, lines, words = [], [], []
    for piece, (left, top) in zip(pieces, places, strict=True):
        corner = np.array([left, top]) + piece.border_mm
        areas += [Area(tuple(outline + corner for outline in area.outlines)) for area in piece.areas]
        lines += _frame(left, top, piece.width_mm, piece.height_mm)
        words.append(Words((left, top + piece.height_mm + 1.5 * _WORDS_mm), piece.title))
    bar = _MARGIN_mm, size[1] - _MARGIN_mm - 12.0
    lines += check_bar(bar)
    words += [
        Words((bar[0], bar[1] + 6.0), f"{CHECK_BAR_mm:g} mm between the outer ends of the ticks. Print at 100 %."),
        Words((bar[0], bar[1] + 10.5), "Measure the bar, then: tactile-lab markers ... --measured-mm LENGTH"),
    ]
    return Sheet(size, tuple(areas), tuple(lines), tuple(words))


def check_bar(start: tuple[float, float]) -> list[Line]:
    """A bar of 100 mm with a tick at each end; the ticks' outer edges are 100 mm apart."""
    (x, y), end, half = start, start[0] + CHECK_BAR_mm, 0.1
    ticks = [Line((at, y - 3.0), (at, y + 3.0), 2 * half) for at in (x + half, end - half)]
    marks = [Line((x + step, y - 1.2), (x + step, y + 1.2), 0.15) for step in np.arange(10.0, CHECK_BAR_mm, 10.0)]
    return [Line((x, y), (end, y), 0.3), *ticks, *marks]


def _frame(left: float, top: float, width: float, height: float) -> list[Line]:
    """Thin grey lines to cut along, just outside the white border."""
    corners = [(left, top), (left + width, top), (left + width, top + height), (left, top + height)]
    return [Line(a, b, 0.1, grey=True) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]


def _piece(print_: AnyBoard) -> _Piece:
    width, height = (1e3 * size for size in print_.size_m)
    if isinstance(print_, Chessboard):
        square = 1e3 * print_.square_m
        areas, border = [Area(tuple(square * outline for outline in outlines(print_.is_black > 0)))], square / 2
        title = f"chessboard {print_.columns} x {print_.rows}  squares {square:g} mm"
        return _Piece(width + 2 * border, height + 2 * border, border, tuple(areas), title)
    if isinstance(print_, SingleMarker):
        areas, module = [_marker(print_, print_.number, (0.0, 0.0), width)], width / print_.modules
        title = f"{print_.dictionary}  id {print_.number}  {width:g} mm"
    elif isinstance(print_, GridBoard | AprilGrid):
        areas, module = _grid(print_), 1e3 * print_.side_m / print_.modules
        numbers = f"ids {print_.numbers[0]}-{print_.numbers[-1]}"
        sides = f"markers {1e3 * print_.side_m:g} mm, gaps {1e3 * print_.gap_m:g} mm"
        title = f"{print_.dictionary}  {print_.kind} {print_.columns} x {print_.rows}  {numbers}  {sides}"
    else:
        areas, module = _charuco(print_), 1e3 * print_.marker_m / print_.modules
        sides = f"squares {1e3 * print_.square_m:g} mm, markers {1e3 * print_.marker_m:g} mm"
        title = f"{print_.dictionary}  ChArUco {print_.columns} x {print_.rows}  {sides}"
    border = WHITE_MODULES * module
    return _Piece(width + 2 * border, height + 2 * border, border, tuple(areas), title)


def _grid(board: GridBoard | AprilGrid) -> list[Area]:
    width, height = board.size_m
    areas = _squares(board) if isinstance(board, AprilGrid) else []
    for number in board.numbers:
        x, y = board.marker_corners_m(number)[0, :2] / board.scale
        corner = (1e3 * (float(x) + width / 2), 1e3 * (height / 2 - float(y)))
        areas.append(_marker(board, number, corner, 1e3 * board.side_m))
    return areas


def _squares(board: AprilGrid) -> list[Area]:
    """The black squares between the tags' corners."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return [Area((1e3 * (corner + board.gap_m * square),)) for corner in board.square_corners_m]


def _charuco(board: CharucoBoard) -> list[Area]:
    squares = np.ones((board.rows, board.columns), bool)
    markers = []
    corners = (np.asarray(points, float) for points in board.opencv_board.getObjPoints())
    for number, points in zip(np.ravel(board.opencv_board.getIds()), corners, strict=True):
        column, row = (points.mean(axis=0)[:2] // board.square_m).astype(int)
        squares[row, column] = False
        left, top = 1e3 * points.min(axis=0)[:2]
        markers.append(_marker(board, int(number), (float(left), float(top)), 1e3 * board.marker_m))
    return [Area(tuple(1e3 * board.square_m * outline for outline in outlines(squares))), *markers]


def _marker(print_: MarkerPrint, number: int, corner: tuple[float, float], side: float) -> Area:
    modules = print_.modules
    black = print_.marker_image(number, modules) < 128
    return Area(tuple(outline * side / modules + corner for outline in outlines(black)))


def outlines(black: NDArray[np.bool_]) -> list[Array]:
    """Outlines of the black cells of a grid, each shape (n, 2) as column and row of cell corners.

    Every black cell contributes its four edges. An edge between two black cells occurs twice, in opposite directions,
    and cancels. The remaining edges are joined to loops.
    """
    edges: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for start, end in _outer_edges(black):
        edges.setdefault(start, []).append(end)
    loops = []
    while edges:
        start = next(iter(edges))
        loop, at = [start], _take(edges, start)
        while at != start:
            loop.append(at)
            at = _take(edges, at)
        loops.append(_without_straight_corners(np.array(loop, float)))
    return loops


def _outer_edges(black: NDArray[np.bool_]) -> Iterable[tuple[tuple[int, int], tuple[int, int]]]:
    padded = np.pad(black, 1)
    for row, column in np.argwhere(black).tolist():
        around = ((row, column + 1), (row + 1, column + 2), (row + 2, column + 1), (row + 1, column))
        corners = ((column, row), (column + 1, row), (column + 1, row + 1), (column, row + 1))
        for side, (r, c) in enumerate(around):
            if not padded[r, c]:
                yield corners[side], corners[(side + 1) % 4]


def _take(edges: dict[tuple[int, int], list[tuple[int, int]]], start: tuple[int, int]) -> tuple[int, int]:
    end = edges[start].pop()
    if not edges[start]:
        del edges[start]
    return end


def _without_straight_corners(loop: Array) -> Array:
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    turns = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(loop[turns != 0], float)
