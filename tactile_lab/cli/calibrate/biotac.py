"""``tactile-lab calibrate biotac``: learn contact normals from presses."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from drivers.biotac.normal_training import MethodErrors

from tactile_lab.cli.calibrate.options import Notes
from tactile_lab.cli.calibrate.steps import OUTSIDE
from tactile_lab.cli.options import Json, NoInput, writable_file


class Finger(StrEnum):
    """Finger names used in calibration files."""

    FF = "FF"
    MF = "MF"
    RF = "RF"
    LF = "LF"
    TH = "TH"


def biotac(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Table of presses: e1,...,e19,nx,ny,nz.")],
    normals: Annotated[
        Path | None, typer.Option(help="Text file of normals, if RECORDING is a text file with electrodes only.")
    ] = None,
    finger: Annotated[Finger, typer.Option(help="Finger that carries the sensor.")] = Finger.FF,
    installation: Annotated[
        str, typer.Option("--rig", help="Installation (of the rig file) that the calibration is for.")
    ] = "sim",
    serial: Annotated[str, typer.Option(help="Serial number of the sensor.")] = "",
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write or to add the finger to. Without it the methods are only compared.",
            callback=writable_file,
        ),
    ] = None,
    sensor_frame: Annotated[
        bool,
        typer.Option(
            "--sensor-frame", help="The normals are in the BioTac frame; otherwise the rotation is estimated."
        ),
    ] = False,
    notes: Notes = "",
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Learn a BioTac's contact normals from presses on a plate with a known normal.

    Every method is trained on the first half of the recording and tested on the second half; the stored model is
    trained on all of it. A rig uses the file named by "calibration.normals" in its rig file. Rows without a normal are
    untouched samples, used as the tare.

    Exit code 0: PASS; 3: FAIL, the model is written as NAME.failed.yaml; 2: the recording cannot be used.
    """
    from dataclasses import asdict

    from calibration.fingertip.normals import calibrate_normals, normals_record
    from calibration.store.store import target_file, write_record
    from drivers.biotac.press_recording import read_presses
    from tactile_lab.cli.console import answer, emit_json, show_table

    del no_input
    found = calibrate_normals(read_presses(recording, normals), in_sensor_frame=sensor_frame)
    if out is not None:
        record = normals_record(found, finger, installation, serial=serial, notes=notes, earlier=out)
        out = target_file(out, record)
        write_record(out, record)
    if as_json:
        rows = [asdict(row) for row in found.methods]
        emit_json({"file": str(out) if out else None, "passed": found.passed, "share": found.share, "methods": rows})
    else:
        columns = ["method", "median", "90 %", "sigma", "in 68 %", "in 95 %"]
        cells = [_cells(row) for row in found.methods]
        show_table("Angle to the measured normal on the second half, degrees", columns, cells, right=(1, 2, 3, 4, 5))
        answer(
            f"median error of the learned normals: {found.share:.2f} of that of equation 2.24 with squeezed electrodes"
        )
        answer("PASS" if found.passed else "FAIL", "bold green" if found.passed else "bold red")
    if not found.passed:
        raise typer.Exit(OUTSIDE)


def _cells(row: MethodErrors) -> list[str]:
    angles = (f"{value:.1f}" for value in (row.median_deg, row.ninety_deg, row.sigma_deg))
    return [row.method, *angles, *(f"{share:.0%}" for share in (row.within_68, row.within_95))]
