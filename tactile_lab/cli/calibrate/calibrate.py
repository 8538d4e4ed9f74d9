"""``tactile-lab calibrate``: wizards that end with a number, and the store of what they found.

The wizards' steps are in the package :mod:`calibration` and print nothing; here they are shown and asked for.
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

app = typer.Typer(help="Calibrations: make one, look at one.", no_args_is_help=True)
app.command("biotac")(biotac)
app.command("forearm")(forearm)
app.command("joints")(joints)
app.command("fingertip")(fingertip)
app.command("electrodes")(electrodes)
app.command("camera")(camera)


@app.command("show")
def show(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Stored calibrations.")],
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Show stored calibrations: what was found, how well, when, on which devices.

    Exit code 0; 2: a file is no stored calibration, or was changed by hand.
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
