"""``tactile-lab``: the entry point and the meaning of its exit codes.

0 done, 1 failed, 2 usage, 3 done with data loss or outside a calibration limit, 4 hardware not
ready, 130 interrupted.
"""

from __future__ import annotations

import sys

import typer

from tactile_lab.cli import bench, evaluate, report, rig, run, session, sweep
from tactile_lab.cli.console import complain
from tactile_lab.errors import TactileLabError

app = typer.Typer(
    help="Tactile SLAM in the laboratory: the shape and pose of an unknown object from a few fingertip contacts.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("run")(run.run)
app.command("evaluate")(evaluate.evaluate)
app.command("report")(report.report)
app.command("sweep")(sweep.sweep)
app.command("bench")(bench.bench)
app.add_typer(session.app, name="session")
app.add_typer(rig.app, name="rig")


def main() -> None:
    """Run the command line; every error a person can cause ends here as one line."""
    try:
        app(prog_name="tactile-lab")
    except TactileLabError as error:
        complain(str(error))
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
