"""Printed sheets: true size, white borders, and markers that the detection reads from the very outlines written."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera.boards import AnyBoard, CharucoBoard, GridBoard, SingleMarker, load_board
from drivers.camera.detection import detect
from drivers.camera.frames import Image
from drivers.camera.markers import MarkerSettings
from drivers.camera.printing.print_files import pdf_bytes, svg_text
from drivers.camera.printing.print_layout import check_bar, outlines, sheet_of
from drivers.camera.targets.april_grid import AprilGrid
from drivers.camera.targets.chessboard import Chessboard
from drivers.core.calibration_file import load_parameters
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError
from tactile_lab.workflow.printing import measure, print_rig_markers, print_sheet

PX_PER_mm = 5.0


def paint(loops: list[list[Array]], size_mm: tuple[float, float]) -> Image:
    """The areas as a printer would black them."""
    width, height = (round(PX_PER_mm * size) for size in size_mm)
    picture = np.full((height, width), 255, np.uint8)
    for area in loops:
        corners = [np.rint((PX_PER_mm * loop - 0.5) * 16).astype(np.int32) for loop in area]
        cv2.fillPoly(picture, corners, 0, cv2.LINE_8, 4)
    return picture


def svg_areas(text: str) -> list[list[Array]]:
    root = ElementTree.fromstring(text)
    paths = [element.get("d", "") for element in root.iter() if element.tag.endswith("path")]
    return [[_numbers(loop) for loop in path.split("Z") if loop.strip()] for path in paths]


def _numbers(loop: str) -> Array:
    return np.array([float(n) for n in re.findall(r"-?\d+\.?\d*", loop)]).reshape(-1, 2)


def pdf_areas(content: bytes, height_mm: float) -> list[list[Array]]:
    """Filled paths of the page, in millimetres from the top left; PDF counts points from the bottom left."""
    areas, loops, points = [], [], []
    matrix = np.eye(3)
    stack = []
    for line in content.decode("latin-1").splitlines():
        for command in re.finditer(r"((?:-?[\d.]+ )*)(cm|m|l|h|f\*|q|Q)(?= |$)", line):
            values, name = [float(v) for v in command[1].split()], command[2]
            if name == "q":
                stack.append(matrix)
            elif name == "Q" and stack:
                matrix = stack.pop()
            elif name == "cm":
                a, b, c, d, e, f = values
                matrix = np.array([[a, b, 0], [c, d, 0], [e, f, 1]]) @ matrix
            elif name in "ml" and len(values) == 2:
                points.append((np.array([*values, 1.0]) @ matrix)[:2])
            elif name == "h" and points:
                loops.append(np.array(points))
                points = []
            elif name == "f*" and loops:
                areas.append([np.array([0, height_mm]) + loop * [25.4 / 72, -25.4 / 72] for loop in loops])
                loops = []
    return areas


@pytest.mark.parametrize(
    "board",
    [CharucoBoard(), GridBoard(), pytest.param(Chessboard(), marks=pytest.mark.long), AprilGrid()],
    ids=lambda board: board.kind,
)
def test_a_board_is_read_whole_and_at_true_size_from_svg_and_pdf(board: AnyBoard) -> None:
    sheet = sheet_of([board])
    for areas in (svg_areas(svg_text(sheet)), pdf_areas(pdf_bytes(sheet), sheet.size_mm[1])):
        points, pixels = board.match_corners(paint(areas, sheet.size_mm))
        assert len(points) == board.point_count
        spread_mm = np.ptp(pixels, axis=0) / PX_PER_mm
        np.testing.assert_allclose(spread_mm, 1e3 * np.ptp(points[:, :2], axis=0), atol=0.2)


def test_sizes_in_both_files_are_exact() -> None:
    sheet = sheet_of([SingleMarker(number=5, side_m=0.0421)])
    for areas in (svg_areas(svg_text(sheet)), pdf_areas(pdf_bytes(sheet), sheet.size_mm[1])):
        np.testing.assert_allclose(np.ptp(np.concatenate(areas[0]), axis=0), 42.1, atol=0.002)


def test_single_markers_have_their_size_number_and_half_a_module_of_white() -> None:
    sheet = sheet_of([SingleMarker(number=0), SingleMarker(number=7, side_m=0.035)])
    found = detect(paint(svg_areas(svg_text(sheet)), sheet.size_mm), "DICT_4X4_50")
    assert sorted(found) == [0, 7]
    for number, side_mm in ((0, 50.0), (7, 35.0)):
        assert np.ptp(found[number], axis=0) / PX_PER_mm == pytest.approx([side_mm, side_mm], abs=0.2)
    black = np.concatenate(sheet.areas[0].outlines)
    frame = np.array([point for line in sheet.lines[:4] for point in (line.start, line.end)])
    np.testing.assert_allclose(black.min(axis=0) - frame.min(axis=0), 50.0 / 6 / 2)
    np.testing.assert_allclose(frame.max(axis=0) - black.max(axis=0), 50.0 / 6 / 2)


def test_the_check_bar_is_a_hundred_millimetres_between_the_outer_edges_of_its_ticks() -> None:
    ticks = [line for line in check_bar((10.0, 20.0)) if line.width_mm == 0.2]
    left, right = ticks[0].start[0] - 0.1, ticks[1].start[0] + 0.1
    assert right - left == pytest.approx(100.0)


def test_the_printed_bar_is_no_longer_by_the_ends_of_its_strokes() -> None:
    content = pdf_bytes(sheet_of([SingleMarker(number=7, side_m=0.035)]))
    numbers = re.findall(rb"(?m)^([\d.]+) ([\d.]+) ([\d.]+) (-?[\d.]+) re", content)
    areas_mm = [25.4 / 72 * np.array(area, float) for area in numbers]
    bar = [area for area in areas_mm if abs(area[3]) == pytest.approx(0.3, abs=0.01)]
    ticks = [area for area in areas_mm if area[2] == pytest.approx(0.2, abs=0.01)]
    outer_mm = max(tick[0] + tick[2] for tick in ticks) - min(tick[0] for tick in ticks)
    assert (bar[0][2], outer_mm) == pytest.approx((100.0, 100.0), abs=0.01)
    assert not re.search(rb"(?m) l\s+S$", content), "a stroke's caps would add to its length"


def test_a_sheet_names_what_is_on_it_and_the_page_is_not_to_be_scaled() -> None:
    sheet = sheet_of([SingleMarker(number=7, side_m=0.035)])
    words = " ".join(words.text for words in sheet.words)
    assert "DICT_4X4_50" in words
    assert "id 7" in words
    assert "35 mm" in words
    content = pdf_bytes(sheet)
    assert b"/PrintScaling /None" in content
    width, height = (float(n) for n in re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", content)[0])
    assert (width, height) == pytest.approx((210 * 72 / 25.4, 297 * 72 / 25.4), abs=0.01)


def test_black_cells_that_touch_have_one_outline_and_holes_another() -> None:
    ring = np.ones((3, 3), bool)
    ring[1, 1] = False
    found = outlines(ring)
    assert sorted(len(loop) for loop in found) == [4, 4]
    assert {float(np.ptp(loop[:, 0])) for loop in found} == {3.0, 1.0}
    diagonal = outlines(np.eye(2, dtype=bool))
    assert sum(len(loop) for loop in diagonal) == 8


def test_what_does_not_fit_is_refused_with_the_room_there_is() -> None:
    with pytest.raises(ConfigurationError, match=r"285 x 205 mm do not fit on A4, which has room for 190 x 247 mm"):
        sheet_of([CharucoBoard(square_m=0.04, marker_m=0.03)])
    sheet_of([CharucoBoard(square_m=0.045, marker_m=0.03)], "A3")
    with pytest.raises(ConfigurationError, match="no paper called 'A9'"):
        sheet_of([SingleMarker()], "A9")


def test_a_measured_bar_is_stored_and_one_that_is_off_leaves_the_file_alone(tmp_path: Path) -> None:
    printed = print_sheet({"charuco": CharucoBoard()}, tmp_path, "charuco", "A4")
    assert not printed.measured
    (description,) = printed.descriptions
    assert load_board(description).scale == 1.0
    assert measure(description, 99.7) == pytest.approx(0.997)
    assert load_board(description).scale == pytest.approx(0.997)
    before = description.read_bytes()
    with pytest.raises(ConfigurationError, match=r"at most 0\.5 % are allowed"):
        measure(description, 98.0)
    assert description.read_bytes() == before


def test_the_rigs_markers_get_their_true_scale(tmp_path: Path) -> None:
    source = tmp_path / "markers.yaml"
    source.write_text("world_side_m: 0.06\nobject_id: 9\n")
    printed = print_rig_markers(source, tmp_path / "out", "A4", 100.3)
    settings = load_parameters(printed.descriptions[0], MarkerSettings)
    assert settings.print_scale == pytest.approx(1.003)
    assert (settings.object_id, settings.world_side_m) == (9, 0.06)
    found = detect(paint(svg_areas(printed.svg.read_text()), (210.0, 297.0)), "DICT_4X4_50")
    assert sorted(found) == [0, 9]
    with pytest.raises(ConfigurationError, match=r"0\.5 %"):
        print_rig_markers(source, tmp_path / "out", "A4", 99.0)
