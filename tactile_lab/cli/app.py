"""All commands of ``tactile-lab`` in one place."""

from __future__ import annotations

from typing import Annotated

import typer

from tactile_lab.cli import (
    bench,
    calibrate,
    evaluate,
    experiment,
    markers,
    reconstruct,
    report,
    rig,
    run,
    session,
    sweep,
    view,
)

app = typer.Typer(
    help="Tactile SLAM in the laboratory: the shape and pose of an unknown object from a few fingertip contacts.",
    epilog="Exit codes: 0 done, 1 failed, 2 usage, 3 done with data loss or outside a limit, 4 hardware not ready, "
    "130 interrupted.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",  # lines of a paragraph flow together
    pretty_exceptions_enable=False,
)
app.command("run")(run.run)
app.command("reconstruct")(reconstruct.reconstruct)
app.command("evaluate")(evaluate.evaluate)
app.command("report")(report.report)
app.command("view")(view.view)
app.command("markers")(markers.markers)
app.command("sweep")(sweep.sweep)
app.command("bench")(bench.bench)
app.command("experiment")(experiment.experiment)
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(session.app, name="session")
app.add_typer(rig.app, name="rig")


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"tactile-lab {version('tactile-lab')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Options of the program itself."""
