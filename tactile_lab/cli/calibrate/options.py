"""Options that the calibrations have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tactile_lab.cli.options import LARGEST_SEED, writable_file

Replace = Annotated[bool, typer.Option("--replace", help="Replace an existing result without asking.")]
Notes = Annotated[str, typer.Option(help="Notes to store with the result.")]
SimulationSeed = Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Random seed of a simulated rig.")]
"""Of calibrations on a rig."""

Record = Annotated[Path | None, typer.Option(help="Also write what was measured to this file.", callback=writable_file)]


def result_file(name: str) -> Any:
    """The option of the file for the result.

    Args:
        name: of the file in the folder of its installation.
    """
    place = f"calibrations/INSTALLATION/{name}.yaml"
    return typer.Option(help="File to write the result to.", show_default=place, callback=writable_file)
