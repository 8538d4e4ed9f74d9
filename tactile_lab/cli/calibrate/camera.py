"""``tactile-lab calibrate camera``: the lens, from a board held in front of the camera or from recorded pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.calibrate.options import Notes, Replace, result_file
from tactile_lab.cli.options import Json, NoInput
from tactile_lab.cli.running.page_address import PORT, Certificate, Listen, PageAddress, Port, Token, View

if TYPE_CHECKING:
    from calibration.camera.intrinsics import LensResult
    from drivers.camera.boards import AnyBoard
    from tactile_lab.cli.calibrate.wizard import Asker
    from tactile_lab.workflow.calibrating_camera import Gathering


def camera(
    source: Annotated[
        str,
        typer.Argument(help="Camera (0, /dev/video0), folder of pictures, video, gstreamer:PIPELINE, simulated:board."),
    ],
    board: Annotated[
        Path | None,
        typer.Option(help="Description of the board, from 'tactile-lab markers', or Kalibr's target file."),
    ] = None,
    out: Annotated[Path | None, result_file("camera")] = None,
    installation: Annotated[
        str, typer.Option(help="Installation (of the rig file) that the camera belongs to.")
    ] = "laboratory",
    serial: Annotated[str, typer.Option(help="Serial number of the camera.")] = "",
    size: Annotated[str, typer.Option(help="Image size to request from the camera, such as 1280x720.")] = "1280x720",
    exposure_ms: Annotated[float | None, typer.Option(help="Fix the camera's exposure.")] = None,
    focus: Annotated[float | None, typer.Option(help="Fix the camera's focus, in its driver's units.")] = None,
    views: Annotated[int, typer.Option(min=5, max=10_000, help="Minimum number of views for a PASS.")] = 12,
    most: Annotated[int, typer.Option(min=5, max=10_000, help="Stop after this many views.")] = 60,
    third_radial: Annotated[
        bool, typer.Option("--k3", help="Estimate a third radial distortion coefficient, for wide lenses.")
    ] = False,
    replace: Replace = False,
    notes: Notes = "",
    view: View = False,
    view_port: Port = PORT,
    listen: Listen = "127.0.0.1",
    token: Token = "",
    certificate: Certificate = None,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Calibrate a camera lens, showing which views are still missing, and store the result with its errors and a
    verdict.

    Ctrl+C or q at any step stores nothing.

    Exit code 0: PASS; 2: no result could be computed; 3: FAIL, outside its limits (stored as NAME.failed.yaml, which
    sessions refuse); 4: the camera failed; 130: ended by the operator.
    """
    from calibration.camera.intrinsics import LensLimits, calibrate_lens
    from drivers.camera.boards import load_board
    from drivers.camera.source_settings import CameraSourceSettings
    from drivers.core.clock import MonotonicClock
    from drivers.core.configuration import validate
    from drivers.core.installed.extras import require_package
    from tactile_lab.cli.calibrate.steps import store_result
    from tactile_lab.cli.calibrate.wizard import may_write, wizard
    from tactile_lab.workflow.calibrating_camera import LENS_COMMENT, gather_views, lens_record

    file = out or Path("calibrations") / installation / "camera.yaml"
    page = PageAddress.if_wanted(view, listen, view_port, token, certificate)
    with wizard("calibrate camera", no_input, page) as asker:
        require_package("cv2")
        may_write(file, replace, asker, no_input)
        shown = load_board(board) if board is not None else _usual_board()
        wanted = {"source": source, "size_px": _size(size), "exposure_ms": exposure_ms, "focus": focus}
        settings = validate(wanted, CameraSourceSettings, where="calibrate camera")
        _begin(shown, asker)

        def goes_on() -> bool:
            return asker.take_answer() != "d"

        found = gather_views(settings, shown, MonotonicClock(), most=most, least=views, told=_guide, goes_on=goes_on)
        limits = LensLimits(views=views)
        result = calibrate_lens(found.views, limits, third_radial=third_radial)
        _show(found, result)
        record = lens_record(result, installation, shown, limits, serial, notes)
        store_result(file, record, asker, as_json, LENS_COMMENT)


def _usual_board() -> AnyBoard:
    from drivers.camera.boards import CharucoBoard

    return CharucoBoard()


def _begin(board: AnyBoard, asker: Asker) -> None:
    """Explain what to do. Raises InterruptionError when the person quits."""
    from tactile_lab.cli.console import say, warn

    if board.measured_bar_mm is None:
        warn("the board's check bar was not measured. The lens calibration does not depend on it, but distances would")
    say("Show the board in all parts of the picture, tilted in every direction, near and far.")
    asker.choose("While pictures are taken: d and Enter to finish, q and Enter to quit.", {"": "begin"}, "")
    asker.offer("Show the board in all parts of the picture, tilted in every direction, near and far.", {"d": "done"})


def _guide(found: Gathering) -> None:
    """One line per view: how many there are, and what is missing next."""
    from tactile_lab.cli.console import count, say

    if found.newest in found.refused:
        say(f"{found.newest}: rejected, {found.refused[found.newest]}", "dim")
        return
    missing = found.coverage.missing
    rest = f"; and {len(missing) - 1} more" if len(missing) > 1 else ""
    say(
        f"{count(len(found.views), 'view')}; next: {missing[0]}{rest}"
        if missing
        else f"{count(len(found.views), 'view')}; coverage complete"
    )


def _show(found: Gathering, result: LensResult) -> None:
    from tactile_lab.cli.console import complain, show_facts, show_table, warn

    lens, sigmas = result.lens, result.sigmas
    values = dict(zip(("fx_px", "fy_px", "cx_px", "cy_px"), (*lens.focal_px, *lens.centre_px), strict=True))
    values |= dict(zip(("k1", "k2", "p1", "p2", "k3"), lens.distortion, strict=False))
    rows = [(name, f"{values[name]:.5g}", f"{sigma:.2g}") for name, sigma in sigmas.items()]
    show_table("Lens", ["parameter", "value", "standard deviation"], rows, right=(1, 2))
    worst = max(result.per_view_px, key=result.per_view_px.__getitem__)
    facts = [
        ("views", f"{len(result.per_view_px)} of {found.pictures} pictures used, {found.alike} too similar"),
        ("reprojection", f"{result.reprojection_px:.3f} px; worst {result.per_view_px[worst]:.3f} px ({worst})"),
        ("held-out views", f"{result.held_out_px:.3f} px"),
    ]
    show_facts("Errors", facts)
    for name, error in result.left_out.items():
        warn(f"{name} disagrees with the others ({error:.2f} px) and was excluded")
    for problem in result.problems:
        complain(problem)


def _size(text: str) -> tuple[int, int]:
    width, cross, height = text.partition("x")
    if not (cross and width.isdigit() and height.isdigit()):
        raise typer.BadParameter(f"{text!r} is not a size such as 1280x720", param_hint="'--size'")
    return int(width), int(height)
