"""``tactile-lab session catalogue``: all sessions of a laboratory as one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.options import Json, NoInput, writable_file


def catalogue(
    roots: Annotated[
        list[Path] | None, typer.Argument(metavar="[FOLDER]...", help="Folders of sessions.", show_default="runs")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the table to this .parquet or .csv file.", callback=writable_file),
    ] = None,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Make one table of all sessions: what was done, with what, and how well (docs/sessions.md names the columns).

    Exit code 3 if a session cannot be read; it is in the table with its problem.
    """
    from sessions.exchange.addresses import address_of
    from tactile_lab.cli.console import answer, count, emit_json, show_table, warn
    from tactile_lab.workflow.cataloguing import catalogue, check_table, write_catalogue

    del no_input
    if out is not None:
        check_table(out)
    lines = catalogue(roots or [Path("runs")])
    if out is not None:
        write_catalogue(lines, out)
        answer(f"{count(len(lines), 'session')}: {address_of(out) or out}")
    if as_json:
        emit_json(lines)
    elif out is None:
        shown = ["session", "status", "object", "grasps", "evaluated_method", "hausdorff_best_fit_mm", "pose_rmse_mm"]
        rows = [["" if line[name] is None else str(line[name]) for name in shown] for line in lines]
        show_table("catalogue", shown, rows, right=(3, 5, 6))
    damaged = [line for line in lines if line["status"] == "damaged"]
    for line in damaged:
        warn(f"{line['session']}: {line['problem']}")
    if damaged:
        raise typer.Exit(3)
