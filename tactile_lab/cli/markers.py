"""``tactile-lab markers``: printable sheets of markers and boards at true size."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tactile_lab.cli.options import Json, writable_folder

if TYPE_CHECKING:
    from drivers.camera.boards import AnyBoard
    from tactile_lab.workflow.printing import PrintedSheet

LEAST_mm, MOST_mm = 0.1, 10_000.0
MOST_SQUARES, MOST_MARKERS = 1000, 1_000_000
"""Bounds of options; a kind of print and a dictionary have narrower ones."""

KINDS = {
    "single": {"number", "dictionary", "side_m"},
    "grid": {"dictionary", "columns", "rows", "side_m", "gap_m"},
    "charuco": {"dictionary", "columns", "rows", "square_m", "marker_m"},
    "chessboard": {"columns", "rows", "square_m"},
    "aprilgrid": {"dictionary", "columns", "rows", "side_m", "gap_m"},
    "rig": set[str](),
}
"""What can be printed, and the options of each; for rig markers the rig file has them."""


def markers(
    what: Annotated[
        str,
        typer.Argument(
            metavar="WHAT",
            help="single, grid, charuco, chessboard, aprilgrid or rig; or the .yaml file of a print, to store its "
            "measured check bar.",
        ),
    ],
    number: Annotated[
        list[int] | None, typer.Option(min=0, max=MOST_MARKERS, help="Number (ID) of a single marker. Can be repeated.")
    ] = None,
    side_mm: Annotated[
        float | None,
        typer.Option(
            min=LEAST_mm, max=MOST_mm, help="Side length of a marker's black square (single, grid, aprilgrid)."
        ),
    ] = None,
    columns: Annotated[int | None, typer.Option(min=1, max=MOST_SQUARES, help="Number of columns of a board.")] = None,
    rows: Annotated[int | None, typer.Option(min=1, max=MOST_SQUARES, help="Number of rows of a board.")] = None,
    gap_mm: Annotated[
        float | None,
        typer.Option(min=LEAST_mm, max=MOST_mm, help="Gap between the markers of a grid, or the tags of an AprilGrid."),
    ] = None,
    square_mm: Annotated[
        float | None,
        typer.Option(min=LEAST_mm, max=MOST_mm, help="Side length of a chessboard's or ChArUco board's squares."),
    ] = None,
    marker_mm: Annotated[
        float | None, typer.Option(min=LEAST_mm, max=MOST_mm, help="Side length of a ChArUco board's markers.")
    ] = None,
    dictionary: Annotated[
        str | None, typer.Option(help="OpenCV name of the marker dictionary, such as DICT_4X4_50.")
    ] = None,
    rig: Annotated[str, typer.Option(help="With 'rig': the rig whose two markers are printed.")] = "sim",
    paper: Annotated[str, typer.Option(help="Paper size: A4, A3, A2 or letter.")] = "A4",
    out: Annotated[Path, typer.Option(help="Folder to write the files to.", callback=writable_folder)] = Path(
        "markers"
    ),
    measured_mm: Annotated[
        float | None,
        typer.Option(
            min=LEAST_mm, max=MOST_mm, help="Length of the print's check bar (nominally 100 mm), measured on the paper."
        ),
    ] = None,
    as_json: Json = False,
    no_input: Annotated[bool, typer.Option("--no-input", help="Never ask for the measured check bar.")] = False,
) -> None:
    """Write markers or a board as PDF and SVG at true size, with a check bar, and a description for marker detection.

    Print at 100 % (actual size), measure the 100 mm check bar and enter its length: detection then uses the true size.
    A print that is more than 0.5 % off is refused.
    """
    if what.endswith((".yaml", ".yml")):
        _store(Path(what), measured_mm, as_json, no_input)
        return
    if what not in KINDS:
        problem = f"{what!r} is neither one of {', '.join(KINDS)} nor a .yaml file"
        raise typer.BadParameter(problem, param_hint="'WHAT'")
    typed: dict[str, Any] = {
        "number": number,
        "dictionary": dictionary,
        "columns": columns,
        "rows": rows,
        "side_m": _m(side_mm),
        "gap_m": _m(gap_mm),
        "square_m": _m(square_mm),
        "marker_m": _m(marker_mm),
    }
    given = {name: value for name, value in typed.items() if value is not None}
    _refuse_others(what, given)
    if what == "rig":
        sheet = _rig_sheet(rig, out, paper, measured_mm)
    else:
        sheet = _board_sheet(what, given.pop("number", [0]), given, out, paper, measured_mm)
    if measured_mm is None and (length := _ask(no_input)) is not None:
        from tactile_lab.workflow.printing import measure

        if what == "rig":
            sheet = _rig_sheet(rig, out, paper, length)
        else:
            for description in sheet.descriptions:
                measure(description, length)
    _tell(sheet, as_json)


def _refuse_others(what: str, given: Mapping[str, object]) -> None:
    """Refuse a size option that would have no effect. Raises BadParameter."""
    for name in given.keys() - KINDS[what]:
        option = "--" + name.removesuffix("_m") + ("-mm" if name.endswith("_m") else "")
        raise typer.BadParameter(f"has no effect for {what}", param_hint=f"'{option}'")


def _rig_sheet(rig: str, out: Path, paper: str, measured_mm: float | None) -> PrintedSheet:
    from drivers.core.errors import ConfigurationError
    from tactile_lab.rigs.description import load_rig
    from tactile_lab.workflow.printing import print_rig_markers

    files = load_rig(rig).files
    if "markers" not in files:
        raise ConfigurationError(
            "has no camera and therefore no markers", where=rig, hint="Choose another rig with --rig"
        )
    return print_rig_markers(files["markers"], out, paper, measured_mm)


def _board_sheet(
    kind: str, numbers: list[int], given: dict[str, Any], out: Path, paper: str, measured_mm: float | None
) -> PrintedSheet:
    from tactile_lab.workflow.printing import print_sheet

    content = given if measured_mm is None else {**given, "measured_bar_mm": measured_mm}
    if kind == "single":
        boards = {f"single-{number}": _board("single", {**content, "number": number}) for number in numbers}
    else:
        boards = {kind: _board(kind, content)}
    return print_sheet(boards, out, kind, paper)


def _board(kind: str, content: dict[str, Any]) -> AnyBoard:
    from drivers.camera.boards import CharucoBoard, GridBoard, SingleMarker
    from drivers.camera.targets.april_grid import AprilGrid
    from drivers.camera.targets.chessboard import Chessboard
    from drivers.core.configuration import validate

    kinds: tuple[type[AnyBoard], ...] = (SingleMarker, GridBoard, CharucoBoard, Chessboard, AprilGrid)
    models = {model.model_fields["kind"].default: model for model in kinds}
    return validate(content, models[kind], where="markers", hint="Change the options")


def _store(description: Path, measured_mm: float | None, as_json: bool, no_input: bool) -> None:
    from tactile_lab.cli.console import answer, emit_json
    from tactile_lab.workflow.printing import check_bar_words, measure

    length = measured_mm if measured_mm is not None else _ask(no_input)
    if length is None:
        raise typer.BadParameter("check bar not measured yet", param_hint="'--measured-mm'")
    scale = measure(description, length)
    if as_json:
        emit_json({"description": str(description), "scale": scale})
    answer(f"{description}: {check_bar_words(scale, True)}")


def _ask(no_input: bool) -> float | None:
    """Ask for the measured check bar on a terminal; None to measure it later."""
    if no_input or not sys.stdin.isatty():
        return None
    answer = typer.prompt(
        "Length of the printed check bar in mm (empty: enter it later)", default="", show_default=False, err=True
    )
    if not str(answer).strip():
        return None
    try:
        return float(str(answer).replace(",", "."))
    except ValueError:
        raise typer.BadParameter(f"{answer!r} is not a length in mm", param_hint="'--measured-mm'") from None


def _tell(sheet: PrintedSheet, as_json: bool) -> None:
    from drivers.camera.boards import load_board
    from tactile_lab.cli.console import answer, emit_json
    from tactile_lab.workflow.printing import check_bar_words

    measured, scale = sheet.measured, sheet.scale
    if sheet.pdf.stem != "rig-markers":
        board = load_board(sheet.descriptions[0])
        measured, scale = board.measured_bar_mm is not None, board.scale
    if as_json:
        files = {"pdf": str(sheet.pdf), "svg": str(sheet.svg), "descriptions": [str(d) for d in sheet.descriptions]}
        emit_json({**files, "scale": scale, "measured": measured})
    answer(f"to print    {sheet.pdf} (100 %, actual size)")
    answer(f"            {sheet.svg}")
    for description in sheet.descriptions:
        answer(f"describes   {description}")
    answer(check_bar_words(scale, measured))


def _m(length_mm: float | None) -> float | None:
    return None if length_mm is None else length_mm / 1e3
