"""``tactile-lab calibrate biotac``: contact normals learned from presses."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from drivers.biotac.normal_training import MethodErrors

from tactile_lab.cli.calibrate.steps import OUTSIDE
from tactile_lab.cli.options import Json, NoInput


class Finger(StrEnum):
    """Fingers, as calibration files name them."""

    FF = "FF"
    MF = "MF"
    RF = "RF"
    LF = "LF"
    TH = "TH"


def biotac(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Table of presses: e1,...,e19,nx,ny,nz.")],
    normals: Annotated[
        Path | None, typer.Option(help="Text file of normals, when RECORDING is a text file of electrodes alone.")
    ] = None,
    finger: Annotated[Finger, typer.Option(help="Finger that carries the sensor.")] = Finger.FF,
    measurer: Annotated[str, typer.Option("--rig", help="Name of the rig (its station) that the file is for.")] = "sim",
    serial: Annotated[str, typer.Option(help="Serial number of the sensor.")] = "",
    out: Annotated[
        Path | None, typer.Option(help="File to write, or to add the finger to; without it methods are compared only.")
    ] = None,
    sensor_frame: Annotated[
        bool, typer.Option("--sensor-frame", help="The normals are in the BioTac frame; otherwise the turn is found.")
    ] = False,
    notes: Annotated[str, typer.Option(help="The operator's notes.")] = "",
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Learn a BioTac's contact normals from presses on a plate whose normal is known.

    Every method is trained on the first half of the recording and judged on the second; what is stored has learned
    from all of it. A rig uses the file that its "calibration.normals" names. Rows without a normal are untouched ones,
    and tare the others.

    Exit code 0: PASS; 3: FAIL, what was learned is written beside the file; 2: the recording cannot be used.
    """
    from dataclasses import asdict

    from calibration.fingertip.normals import calibrate_normals, normals_record
    from calibration.store.store import target_file, write_record
    from drivers.biotac.press_recording import read_presses
    from tactile_lab.cli.console import answer, emit_json, show_table

    del no_input
    found = calibrate_normals(read_presses(recording, normals), in_sensor_frame=sensor_frame)
    if out is not None:
        record = normals_record(found, finger, measurer, serial=serial, notes=notes, earlier=out)
        out = target_file(out, record)
        write_record(out, record)
    if as_json:
        rows = [asdict(row) for row in found.methods]
        emit_json({"file": str(out) if out else None, "passed": found.passed, "share": found.share, "methods": rows})
    else:
        columns = ["method", "median", "90 %", "sigma", "in 68 %", "in 95 %"]
        cells = [_cells(row) for row in found.methods]
        show_table("Angle to the measured normal on the second half, degrees", columns, cells, right=(1, 2, 3, 4, 5))
        answer(f"learned: {found.share:.2f} of the median error of equation 2.24 with squeezed electrodes")
        answer("PASS" if found.passed else "FAIL", "bold green" if found.passed else "bold red")
    if not found.passed:
        raise typer.Exit(OUTSIDE)


def _cells(row: MethodErrors) -> list[str]:
    angles = (f"{value:.1f}" for value in (row.median_deg, row.ninety_deg, row.sigma_deg))
    return [row.method, *angles, *(f"{share:.0%}" for share in (row.within_68, row.within_95))]
