"""Output of a finished session, and its exit code."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer

from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.recording.traffic.stream_counts import LATE_ns
from tactile_lab.cli.console import answer, complain, emit_json, say, warn
from tactile_lab.cli.sessions.evaluation_table import show_evaluation
from tactile_lab.cli.sessions.tables import losses_in_words
from tactile_lab.workflow.finishing import FinishedSession

FILES = (
    ("mesh.ply", "mesh"),
    ("mesh.glb", "for viewers"),
    ("contour.csv", "contour"),
    ("known.ply", "well known"),
    ("known.csv", "well known"),
    ("trajectory.csv", "trajectory"),
    ("evaluation.json", "evaluation"),
    ("report.html", "report"),
)

COMPLETE = ("complete", "")
"""Statuses of estimates with nothing left to find; without an evaluation there is none."""


def conclude(finished: FinishedSession, as_json: bool, extra: Mapping[str, Any] | None = None) -> None:
    """Show the outcome, the evaluation and the files, and raise the exit code (see :mod:`cli.main`).

    With ``as_json`` there is always one document: the evaluation (followed by ``extra``), or
    ``{"error": ..., "session": ...}`` when there is none.
    """
    tell_outcome(finished.outcome, finished.evaluation.status if finished.evaluation else "")
    if as_json:
        emit_json({**_document(finished), **(extra or {})})
    elif finished.evaluation is not None:
        show_evaluation(finished.evaluation.as_json())
    _tell_files(finished)
    _tell_losses(finished)
    for objection in finished.overlooked:
        warn(f"{objection}: allowed, and recorded with the session")
    for reservation in finished.evaluation.warnings if finished.evaluation else ():
        warn(reservation)
    if finished.problem:
        complain(f"no evaluation: {finished.problem}")
    if code := _exit_code(finished):
        raise typer.Exit(code)


def _document(finished: FinishedSession) -> dict[str, Any]:
    if finished.evaluation is not None:
        return finished.evaluation.as_json()
    return {"error": finished.problem, "session": str(finished.folder)}


def tell_outcome(outcome: SessionOutcome | None, status: str) -> None:
    """How the session ended; "complete" only where the estimate is too, however many grasps were done."""
    if outcome is None:
        return
    if outcome.error is not None:
        complain(outcome.reason)
    elif outcome.ending is Ending.COMPLETE:
        say(f"session complete: {outcome.reason}" if status in COMPLETE else _unfinished(outcome, status), "bold")
    else:
        what = "object lost: " if outcome.ending is Ending.OBJECT_LOST else ""
        warn(f"session ended early: {what}{outcome.reason}")


def _unfinished(outcome: SessionOutcome, status: str) -> str:
    return f"session ended as asked: {outcome.reason}; the estimate is {status}, see the warnings"


def _tell_files(finished: FinishedSession) -> None:
    answer(f"{'contact log' if finished.folder.is_file() else 'session':<13}{finished.folder}")
    for name, what in FILES:
        path = finished.results / name
        if path.is_file():
            answer(f"{what:<13}{path}")


def _tell_losses(finished: FinishedSession) -> None:
    if finished.data_loss:
        losses = losses_in_words(finished.data_loss)
        warn(f"incomplete recording (lost, or more than {LATE_ns // 1_000_000} ms late): {losses}")
    if finished.unread:
        warn(f"the recording is damaged: {finished.unread}")


def _exit_code(finished: FinishedSession) -> int:
    outcome = finished.outcome
    if outcome is not None and outcome.error is not None:
        return outcome.error.exit_code
    if outcome is not None and outcome.ending is Ending.INTERRUPTED:
        return 130
    if finished.problem:
        return 1
    lost = finished.evaluation is not None and finished.evaluation.status == "lost"
    lost = lost or (outcome is not None and outcome.ending is Ending.OBJECT_LOST)
    return 3 if lost or finished.data_loss or finished.unread else 0
