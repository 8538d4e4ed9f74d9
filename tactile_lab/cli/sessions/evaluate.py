"""``tactile-lab evaluate``: evaluate sessions again, with another ground truth, or compare them."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import LAST, Json, NoInput, Root, writable_folder
from tactile_lab.cli.sessions.choosing import choose_session

if TYPE_CHECKING:
    from tactile_lab.workflow.comparing import Comparison


class Basis(StrEnum):
    """Source of the ground truth."""

    CORNERS = "corners"
    PICTURES = "pictures"


def evaluate(
    sessions: Annotated[
        list[str], typer.Argument(metavar="SESSION...", help=f"Sessions: folders, names under --root, or {LAST}.")
    ],
    results: Annotated[
        list[str] | None,
        typer.Option(
            help="Results folder inside the sessions, or any path. Can be repeated (default when comparing: all)."
        ),
    ] = None,
    lens: Annotated[
        Path | None, typer.Option(help="Lens calibration for the ground truth, instead of the session's.")
    ] = None,
    markers: Annotated[
        Path | None, typer.Option(help="Marker file for the ground truth, instead of the session's.")
    ] = None,
    basis: Annotated[
        Basis,
        typer.Option(
            "--from",
            help="Compute the ground truth from the recorded corners, or detect markers in the pictures again.",
        ),
    ] = Basis.CORNERS,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the comparison: table, CSV, JSON and plot.", callback=writable_folder),
    ] = None,
    root: Root = Path("runs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Evaluate results against the markers in the recorded pictures and the object's true mesh.

    A single session is evaluated again with its own calibration, and its evaluation files are updated. With several
    sessions, --results, another calibration, --from or --out, the sessions are not changed: all results are compared by
    method, with confidence intervals.
    """
    from tactile_lab.workflow.finishing import TruthChoice

    del no_input
    choice = TruthChoice(lens, markers, basis.value)
    found = [choose_session(root, session) for session in sessions]
    if len(found) == 1 and not results and choice.is_recorded and out is None:
        from tactile_lab.cli.running.results import conclude
        from tactile_lab.workflow.finishing import evaluate_session

        conclude(evaluate_session(found[0]), as_json)
        return
    from tactile_lab.workflow.comparing import compare_sessions, write_comparison

    comparison = compare_sessions(found, results or [], choice)
    files = [] if out is None else write_comparison(comparison, out)
    _tell(comparison, files, as_json)


def _tell(comparison: Comparison, files: list[Path], as_json: bool) -> None:
    from tactile_lab.cli.console import answer, emit_json, say, show_table, warn
    from tactile_lab.evaluation.comparison import short_table

    if as_json:
        emit_json(comparison.as_json())
    else:
        head, *body = short_table(comparison.summaries)
        show_table(f"{len(comparison.runs)} evaluations", head, body)
    for session, report in comparison.truths.items():
        if report is None:
            warn(f"{session}: no camera, so no ground truth")
            continue
        world = f"world marker averaged over {report.world_frames} frames"
        say(f"truth    {session}: from {report.basis}, {report.frames} frames, {world}")
        for reason, count in report.refused.items():
            warn(f"{session}: {count} frames rejected: {reason}")
    for session, offset in comparison.clocks.items():
        known = offset.offset_ms is not None and offset.sigma_ms is not None
        words = f"{offset.offset_ms:+.1f} ms ± {offset.sigma_ms:.1f} ms" if known else f"unknown: {offset.reason}"
        say(f"clocks   {session}: camera to hand {words}")
    for session, lost in comparison.unread.items():
        warn(f"{session}: the recording is damaged: {lost}")
    for file in files:
        answer(f"written  {file}")
    if comparison.unread:
        raise typer.Exit(3)
