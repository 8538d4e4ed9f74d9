"""``tactile-lab calibrate``: calibration wizards, and the store of their results.

The wizards' steps are in the package :mod:`calibration`, which prints nothing; this module shows them and asks the
questions.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.calibrate.biotac import biotac
from tactile_lab.cli.calibrate.camera import camera
from tactile_lab.cli.calibrate.fingertip import fingertip
from tactile_lab.cli.calibrate.forearm import forearm
from tactile_lab.cli.calibrate.hand import electrodes, joints
from tactile_lab.cli.options import Json, NoInput

app = typer.Typer(help="Calibrate devices and show stored calibrations.", no_args_is_help=True)
app.command("biotac")(biotac)
app.command("forearm")(forearm)
app.command("joints")(joints)
app.command("fingertip")(fingertip)
app.command("electrodes")(electrodes)
app.command("camera")(camera)


@app.command("show")
def show(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Stored calibration files.")],
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Show stored calibrations: their values, accuracy, date and devices.

    Exit code 0; 2: a file is not a stored calibration, or was changed by hand.
    """
    from calibration.store.store import read_record
    from drivers.core.calibration_file import plain
    from tactile_lab.cli.calibrate.tables import show_record
    from tactile_lab.cli.console import emit_json

    del no_input
    records = [read_record(file) for file in files]
    if as_json:
        emit_json([{"file": str(file), **plain(record)} for file, record in zip(files, records, strict=True)])
        return
    for file, record in zip(files, records, strict=True):
        show_record(str(file), record)
