"""``tactile-lab run``: the main job."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.loading import interruptions_held
from tactile_lab.cli.options import METHOD_HELP, AllowUncalibrated, Json, Method, NoInput, RigName


def run(
    rig: RigName = "sim",
    object_name: Annotated[
        str, typer.Option("--object", help="Object of the simulated rig's catalogue, or mesh:FILE (metres).")
    ] = "box-10x6x4",
    grasps: Annotated[
        int | None, typer.Option(min=1, help="Number of grasps.", show_default="the rig's, 16 on sim")
    ] = None,
    dimension: Annotated[int, typer.Option(min=2, max=3, help="2: horizontal contour; 3: surface.")] = 2,
    method: Annotated[Method, typer.Option(help=METHOD_HELP)] = Method.JOINT,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything that is left to chance.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder in which the session's folder is made.")] = Path("runs"),
    notes: Annotated[str, typer.Option(help="The operator's notes, kept with the session.")] = "",
    allow_uncalibrated: AllowUncalibrated = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Run an autonomous session: grasp, estimate, choose the next grasp, and judge the result.

    Ctrl+C once finishes the step in hand and closes the session; twice ends at once. Both leave a readable session.
    """
    with interruptions_held():
        from tactile_lab.cli.progress import LiveProgress
        from tactile_lab.cli.results import conclude
        from tactile_lab.cli.session_tables import tell_left_open
        from tactile_lab.workflow.running import SessionRequest, run_session

    del no_input  # an autonomous session asks nothing; the option is there so that scripts can always give it
    tell_left_open(out)
    request = SessionRequest(rig, object_name, out, method, dimension, seed, grasps, notes, allow_uncalibrated)
    with LiveProgress(f"{object_name} on rig {rig}: {dimension}-D, method {method}, seed {seed}") as progress:
        finished = run_session(request, progress)
    conclude(finished, as_json)
