"""How a finished session is shown, and the exit code it deserves."""

from __future__ import annotations

from pathlib import Path

import typer

from tactile_lab.cli.console import complain, emit_json, people, say, table, warn
from tactile_lab.evaluation.evaluation import Evaluation
from tactile_lab.evaluation.table import evaluation_rows
from tactile_lab.workflow import FinishedSession

FILES = (
    ("mesh.ply", "mesh"),
    ("mesh.glb", "mesh for viewers"),
    ("contour.csv", "contour"),
    ("trajectory.csv", "trajectory"),
    ("evaluation.json", "evaluation"),
    ("report.html", "report"),
)


def conclude(finished: FinishedSession, as_json: bool) -> None:
    """Show the outcome, the evaluation and the files; raise the exit code that fits (see :mod:`cli.main`)."""
    _tell_ending(finished)
    if finished.evaluation is not None:
        show_evaluation(finished.evaluation, as_json)
    _tell_files(finished)
    if finished.data_loss:
        losses = ", ".join(f"{number} {kind}" for kind, number in finished.data_loss.items())
        warn(f"data were lost: {losses}")
    if code := _exit_code(finished):
        raise typer.Exit(code)


def show_evaluation(evaluation: Evaluation, as_json: bool) -> None:
    """The evaluation as a table for people, or as the JSON document."""
    content = evaluation.as_json()
    if as_json:
        emit_json(content)
        return
    rows = [(row.label, row.value, row.unit, row.note) for row in evaluation_rows(content)]
    people.print(table(f"Evaluation: {evaluation.object}", ["figure", "value", "unit", "meaning"], rows, right=(1,)))


def _tell_ending(finished: FinishedSession) -> None:
    outcome = finished.outcome
    if outcome is None:
        return
    if outcome.error is not None:
        complain(outcome.reason)
    else:
        say(f"session {outcome.ending}: {outcome.reason}", "bold")


def _tell_files(finished: FinishedSession) -> None:
    if finished.problem:
        warn(f"no evaluation: {finished.problem}")
    say(f"session     {finished.folder}")
    for name, what in FILES:
        path: Path = finished.results / name
        if path.is_file():
            say(f"{what:<18}{path}")


def _exit_code(finished: FinishedSession) -> int:
    outcome = finished.outcome
    if outcome is not None and outcome.error is not None:
        return outcome.error.exit_code
    if outcome is not None and outcome.ending == "interrupted":
        return 130
    if finished.problem:
        return 1
    return 3 if finished.data_loss else 0
