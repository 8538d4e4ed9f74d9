"""All commands of ``tactile-lab`` in one place."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from drivers.core.extensions import load_extension, load_named_extensions
from tactile_lab.cli import bench, experiment, markers, plugins, rig
from tactile_lab.cli.calibrate import calibrate
from tactile_lab.cli.commands import COMMANDS, Commands
from tactile_lab.cli.completion import answer_the_first_tab
from tactile_lab.cli.running import ros2_bridge, run, sweep
from tactile_lab.cli.sessions import evaluate, model, reconstruct, report, session, view

answer_the_first_tab()
app = typer.Typer(
    cls=Commands,
    help="Tactile SLAM in the laboratory: the shape and pose of an unknown object from a few fingertip contacts.",
    epilog="Exit codes: 0 done; 1 failed; 2 not begun, by an option or file that cannot be used; 3 done, but data or "
    "the object were lost, or a limit was passed; 4 a device is not ready; 130 interrupted (docs/command-line.md).",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},  # of all commands
    rich_markup_mode="markdown",  # lines of a paragraph flow together
    pretty_exceptions_enable=False,
)
COMMANDS.register("run", run.run)
COMMANDS.register("reconstruct", reconstruct.reconstruct)
COMMANDS.register("evaluate", evaluate.evaluate)
COMMANDS.register("report", report.report)
COMMANDS.register("view", view.view)
COMMANDS.register("ros2-bridge", ros2_bridge.ros2_bridge)
COMMANDS.register("markers", markers.markers)
COMMANDS.register("sweep", sweep.sweep)
COMMANDS.register("bench", bench.bench)
COMMANDS.register("experiment", experiment.experiment)
COMMANDS.register("calibrate", calibrate.app)
COMMANDS.register("session", session.app)
COMMANDS.register("model", model.app)
COMMANDS.register("rig", rig.app)
COMMANDS.register("plugins", plugins.plugins)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"tactile-lab {version('tactile-lab')}")
        raise typer.Exit


def _load_extensions(files: list[Path] | None) -> None:
    load_named_extensions()
    for file in files or ():
        load_extension(file)


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", "-V", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    extension: Annotated[
        list[Path] | None,
        typer.Option(
            callback=_load_extensions,
            is_eager=True,
            metavar="FILE",
            help="Python file that registers your own policies, shape models, fingertips, metrics or commands "
            "(docs/extending.md). Can be repeated.",
        ),
    ] = None,
) -> None:
    """Global options."""
