"""``tactile-lab calibrate camera``: the lens, from a board held before the camera or from its pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import Json, NoInput

if TYPE_CHECKING:
    from calibration.camera_intrinsics import LensResult
    from drivers.camera.boards import AnyBoard
    from tactile_lab.workflow.calibrating_camera import Gathering


def camera(
    source: Annotated[
        str,
        typer.Argument(help="Camera (0, /dev/video0), folder of pictures, video, gstreamer:PIPELINE, simulated:board."),
    ],
    board: Annotated[
        Path | None, typer.Option(help="Description of the board, as 'tactile-lab markers' wrote it.")
    ] = None,
    out: Annotated[Path, typer.Option(help="File of the result.")] = Path("calibration/camera.yaml"),
    station: Annotated[str, typer.Option(help="Installation it belongs to (a rig file's station).")] = "laboratory",
    serial: Annotated[str, typer.Option(help="Serial number of the camera.")] = "",
    size: Annotated[str, typer.Option(help="Size of a camera's pictures.")] = "1280x720",
    exposure_ms: Annotated[float | None, typer.Option(help="Hold a camera's exposure.")] = None,
    focus: Annotated[float | None, typer.Option(help="Hold a camera's focus, in its driver's units.")] = None,
    views: Annotated[int, typer.Option(min=5, help="Fewest views for a PASS.")] = 12,
    most: Annotated[int, typer.Option(min=5, help="Stop after so many views.")] = 60,
    third_radial: Annotated[bool, typer.Option("--k3", help="A third radial coefficient, for wide lenses.")] = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Calibrate a lens, guided by what is still missing, and store it with its errors and a verdict.

    Exit code 0: inside its limits; 3: stored, but outside of them; 2: nothing could be computed.
    """
    from calibration.camera_intrinsics import LensLimits, calibrate_lens
    from drivers.camera.boards import load_board
    from drivers.camera.source_settings import CameraSourceSettings
    from tactile_lab.calibration_file import plain
    from tactile_lab.cli.console import emit_json, say
    from tactile_lab.clock import MonotonicClock
    from tactile_lab.strict_yaml import validate
    from tactile_lab.workflow.calibrating_camera import gather_views, lens_record, store_lens

    shown = load_board(board) if board is not None else _usual_board()
    wanted = {"source": source, "size_px": _size(size), "exposure_ms": exposure_ms, "focus": focus}
    settings = validate(wanted, CameraSourceSettings, where="calibrate camera")
    _begin(shown, is_live=not no_input)
    found = gather_views(settings, shown, MonotonicClock(), most=most, least=views, told=_guide)
    limits = LensLimits(views=views)
    result = calibrate_lens(found.views, limits, third_radial=third_radial)
    record = lens_record(result, station, shown, limits, serial)
    store_lens(out, record)
    if as_json:
        emit_json({"file": str(out), **plain(record)})
    _show(found, result)
    say(f"stored    {out}")
    if not result.passed:
        raise typer.Exit(3)


def _usual_board() -> AnyBoard:
    from drivers.camera.boards import CharucoBoard

    return CharucoBoard()


def _begin(board: AnyBoard, is_live: bool) -> None:
    from tactile_lab.cli.console import say, warn

    if board.measured_bar_mm is None:
        warn("the board's check bar was not measured: the lens does not depend on it, distances would")
    if is_live:
        say("Show the board in all parts of the picture, tilted each way, near and far. Ctrl-C ends it.")


def _guide(found: Gathering) -> None:
    """One line a view: how many there are, and what is missing next."""
    from tactile_lab.cli.console import say

    name = f"picture {found.pictures}"
    if name in found.refused:
        say(f"{name}: not used, {found.refused[name]}", "dim")
        return
    missing = found.coverage.missing
    rest = f"; and {len(missing) - 1} more" if len(missing) > 1 else ""
    say(
        f"{len(found.views)} views; next: {missing[0]}{rest}"
        if missing
        else f"{len(found.views)} views; all is covered"
    )


def _show(found: Gathering, result: LensResult) -> None:
    from tactile_lab.cli.console import complain, say, show_facts, show_table, warn

    lens, sigmas = result.lens, result.sigmas
    values = dict(zip(("fx_px", "fy_px", "cx_px", "cy_px"), (*lens.focal_px, *lens.centre_px), strict=True))
    values |= dict(zip(("k1", "k2", "p1", "p2", "k3"), lens.distortion, strict=False))
    rows = [(name, f"{values[name]:.5g}", f"{sigma:.2g}") for name, sigma in sigmas.items()]
    show_table("Lens", ["parameter", "value", "standard deviation"], rows, right=(1, 2))
    worst = max(result.per_view_px, key=result.per_view_px.__getitem__)
    facts = [
        ("views", f"{len(result.per_view_px)} used of {found.pictures} pictures, {found.alike} of them alike"),
        ("reprojection", f"{result.reprojection_px:.3f} px; worst {result.per_view_px[worst]:.3f} px ({worst})"),
        ("held-out views", f"{result.held_out_px:.3f} px"),
    ]
    show_facts("Errors", facts)
    for name, error in result.left_out.items():
        warn(f"{name} disagrees with the others ({error:.2f} px) and was left out")
    for problem in result.problems:
        complain(problem)
    say("PASS" if result.passed else "FAIL", "bold green" if result.passed else "bold red")


def _size(text: str) -> tuple[int, int]:
    width, cross, height = text.partition("x")
    if not (cross and width.isdigit() and height.isdigit()):
        raise typer.BadParameter(f"{text!r} is no size like 1280x720", param_hint="'--size'")
    return int(width), int(height)
