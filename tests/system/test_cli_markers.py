"""Sheets of markers as a command: vectors at true size, the measured bar, and what is refused."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from drivers.camera.boards import load_board
from drivers.camera.markers import MarkerSettings
from drivers.core.calibration_file import load_parameters
from tests.support.warm_terminal import WarmProgram

MM = 72 / 25.4  # points of a PDF


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize(
    ("words", "names", "kind"),
    [
        (("single", "--number", 3, "--number", 4, "--side-mm", 40), ["single-3", "single-4"], "single"),
        (("grid", "--columns", 3, "--rows", 2, "--side-mm", 30, "--gap-mm", 8), ["grid"], "grid"),
        (("charuco", "--paper", "A3"), ["charuco"], "charuco"),
        (("chessboard", "--square-mm", 19), ["chessboard"], "chessboard"),
        (("aprilgrid", "--columns", 4, "--rows", 4), ["aprilgrid"], "aprilgrid"),
    ],
)
def test_a_sheet_is_written_as_pdf_and_svg_with_what_describes_it(
    inside: Any, tmp_path: Path, words: tuple[object, ...], names: list[str], kind: str
) -> None:
    answer = inside("markers", *words, "--out", tmp_path, "--no-input", "--json")
    assert answer.code == 0, answer.err
    told = json.loads(answer.out)
    assert files(tmp_path) == sorted([f"{kind}.pdf", f"{kind}.svg", *(f"{name}.yaml" for name in names)])
    assert (told["measured"], told["scale"]) == (False, 1.0)
    assert [load_board(Path(description)).kind for description in told["descriptions"]] == [kind] * len(names)
    assert "check bar not measured yet" in answer.err + answer.out
    width_mm, height_mm = (297, 420) if "A3" in words else (210, 297)
    page = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", Path(told["pdf"]).read_bytes())
    assert page is not None
    assert [float(side) / MM for side in page.groups()] == pytest.approx([width_mm, height_mm], abs=0.01)
    drawing = Path(told["svg"]).read_text()
    assert f'width="{width_mm}mm"' in drawing
    assert f'viewBox="0 0 {width_mm} {height_mm}"' in drawing


def test_the_measured_bar_of_a_print_is_stored_and_one_that_is_off_is_not(inside: Any, tmp_path: Path) -> None:
    assert inside("markers", "charuco", "--out", tmp_path, "--no-input").code == 0
    description = tmp_path / "charuco.yaml"
    answer = inside("markers", description, "--measured-mm", 99.7, "--json")
    assert (answer.code, json.loads(answer.out)["scale"]) == (0, pytest.approx(0.997))
    assert load_board(description).scale == pytest.approx(0.997)
    before = description.read_bytes()
    refused = inside("markers", description, "--measured-mm", 99.2)
    assert (refused.code, "at most 0.5 % are allowed" in refused.err) == (2, True), refused.err
    assert "-0.8 %" in refused.err
    assert description.read_bytes() == before


def test_the_rigs_markers_are_printed_with_the_true_scale(inside: Any, tmp_path: Path) -> None:
    answer = inside("markers", "rig", "--rig", "sim", "--measured-mm", 100.2, "--out", tmp_path, "--no-input")
    assert answer.code == 0, answer.err
    assert "true scale 1.0020" in answer.err + answer.out
    settings = load_parameters(tmp_path / "rig-markers.yaml", MarkerSettings)
    assert settings.print_scale == pytest.approx(1.002)
    printed = (tmp_path / "rig-markers.svg").read_text()
    assert ("id 0  50 mm  on the table" in printed, "id 7  35 mm  under the object" in printed) == (True, True)


@pytest.mark.parametrize("answer_mm", [pytest.param("99,8", marks=pytest.mark.long), ""])
def test_a_person_is_asked_for_the_bar_and_may_answer_later(
    program: WarmProgram, tmp_path: Path, answer_mm: str
) -> None:
    terminal = program.terminal(tmp_path, "markers", "single")
    terminal.until("Length of the printed check bar in mm", f"{answer_mm}\n")
    told = terminal.ended(0)
    assert ("not measured yet" in told) == (not answer_mm)
    board = load_board(tmp_path / "markers" / "single-0.yaml")
    assert board.measured_bar_mm == (99.8 if answer_mm else None)


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("poster",), 2, "neither one of single, grid, charuco"),
        (("charuco", "--paper", "A9"), 2, "no paper called 'A9'"),
        (("charuco", "--square-mm", 60, "--marker-mm", 40), 2, "do not fit on A4"),
        (("charuco", "--square-mm", 20, "--marker-mm", 20), 2, "marker"),
        (("charuco", "--side-mm", 20), 2, "'--side-mm': has no effect for charuco"),
        (("chessboard", "--dictionary", "DICT_4X4_50"), 2, "'--dictionary': has no effect for chessboard"),
        (("single", "--dictionary", "DICT_9X9_50"), 2, "'DICT_9X9_50' is not an OpenCV dictionary. Change"),
        (("single", "--number", 50), 2, "50"),
        (("single", "--side-mm", -4), 2, "'--side-mm': must be greater than or equal to 0.1"),
        (("single", "--measured-mm", 99.2), 2, "at most 0.5 % are allowed"),
        (("grid", "--measured-mm", "nan"), 2, "'--measured-mm': must be"),
        (("rig", "--rig", "nowhere"), 2, "nowhere"),
        (("rig", "--measured-mm", 101), 2, "at most 0.5 % are allowed"),
        (("{folder}/nothing.yaml", "--measured-mm", 100), 2, "file not found"),
        (("{folder}/other.yaml", "--measured-mm", 100), 2, "other.yaml"),
    ],
)
def test_what_can_not_be_printed_or_measured_is_named_and_nothing_is_written(
    inside: Any, tmp_path: Path, words: tuple[object, ...], code: int, told: str
) -> None:
    (tmp_path / "other.yaml").write_text(yaml.safe_dump({"colour": "red"}))
    given = [str(word).format(folder=tmp_path) for word in words]
    answer = inside("markers", *given, "--out", tmp_path / "out", "--no-input")
    assert (answer.code, told in answer.err) == (code, True), answer.err
    assert files(tmp_path) == ["other.yaml"]
