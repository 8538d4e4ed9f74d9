"""Writes sheets of markers and their descriptions, and stores the measured scale of the print."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from drivers.camera.boards import AnyBoard, SingleMarker, load_board
from drivers.camera.markers import MarkerSettings
from drivers.camera.printing.print_files import pdf_bytes, svg_text
from drivers.camera.printing.print_layout import Sheet, sheet_of
from drivers.camera.targets.printed import CHECK_BAR_mm
from drivers.core.atomic_files import write_whole
from drivers.core.calibration_file import load_parameters
from drivers.core.configuration import StrictModel, validate

_HEAD = (
    "# Made by tactile-lab markers; measured_bar_mm is the measured length of the print's check bar, "
    "nominally 100 mm.\n"
)
_RIG_HEAD = "# The printed markers of a rig: use this file as calibration.markers in the rig file.\n"


@dataclass(frozen=True)
class PrintedSheet:
    """Files of one sheet: vectors to print, and a description for each board on it, with its scale (1: as meant)."""

    pdf: Path
    svg: Path
    descriptions: tuple[Path, ...]
    scale: float
    measured: bool


def print_sheet(boards: Mapping[str, AnyBoard], out: Path, name: str, paper: str) -> PrintedSheet:
    """Write NAME.pdf and NAME.svg, and a description of each board under its own name.

    Raises:
        ConfigurationError: the boards do not fit on the paper.
        WriteError: the files cannot be written.
    """
    pdf, svg = _write_vectors(sheet_of(list(boards.values()), paper), out, name)
    descriptions = [_write(out / f"{each}.yaml", _text(board, _HEAD)) for each, board in boards.items()]
    scales = [board.scale for board in boards.values()]
    measured = all(board.measured_bar_mm is not None for board in boards.values())
    return PrintedSheet(pdf, svg, tuple(descriptions), scales[0], measured)


def print_rig_markers(markers_file: Path, out: Path, paper: str, measured_mm: float | None) -> PrintedSheet:
    """A sheet with the world marker and the object's marker of a rig, and the rig's marker file with the true scale.

    Raises:
        ConfigurationError: the file cannot be used, or the bar is half a per cent off.
    """
    settings = load_parameters(markers_file, MarkerSettings)
    sides = {settings.world_id: settings.world_side_m, settings.object_id: settings.object_side_m}
    boards = [_single(settings.dictionary, number, side, measured_mm) for number, side in sides.items()]
    sheet = sheet_of(boards, paper, ("on the table", "under the object"))
    pdf, svg = _write_vectors(sheet, out, "rig-markers")
    true_size = settings.model_copy(update={"print_scale": boards[0].scale})
    description = _write(out / "rig-markers.yaml", _text(true_size, _RIG_HEAD))
    return PrintedSheet(pdf, svg, (description,), boards[0].scale, measured_mm is not None)


def measure(description: Path, measured_mm: float) -> float:
    """Store what the check bar of a print measures; gives the scale.

    Raises:
        ConfigurationError: the file describes no board, or the bar is half a per cent off; it is left as it was.
    """
    board = load_board(description)
    content = {**board.model_dump(mode="json"), "measured_bar_mm": measured_mm}
    measured = validate(content, type(board), where=str(description), hint="Print again; nothing was stored")
    _write(description, _text(measured, _HEAD))
    return measured.scale


def _single(dictionary: str, number: int, side_m: float, measured_mm: float | None) -> SingleMarker:
    content = {"dictionary": dictionary, "number": number, "side_m": side_m, "measured_bar_mm": measured_mm}
    return validate(content, SingleMarker, where="markers", hint="Print again, or choose another marker")


def _write_vectors(sheet: Sheet, out: Path, name: str) -> tuple[Path, Path]:
    return _write(out / f"{name}.pdf", pdf_bytes(sheet)), _write(out / f"{name}.svg", svg_text(sheet))


def _write(path: Path, content: str | bytes) -> Path:
    write_whole(path, content, "Choose another folder with --out")
    return path


def _text(model: StrictModel, head: str) -> str:
    return head + yaml.safe_dump(model.model_dump(mode="json"), sort_keys=False)


def check_bar_words(scale: float, measured: bool) -> str:
    """The print's scale as text."""
    if not measured:
        return f"check bar not measured yet: assumed to be {CHECK_BAR_mm:g} mm"
    return f"check bar measures {CHECK_BAR_mm * scale:g} mm: true scale {scale:.4f}"
