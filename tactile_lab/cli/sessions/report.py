"""``tactile-lab report``: write a session's report again."""

from __future__ import annotations

from pathlib import Path

from tactile_lab.cli.options import Json, NoInput, Root, SessionName
from tactile_lab.cli.sessions.choosing import choose_session


def report(session: SessionName, root: Root = Path("runs"), as_json: Json = False, no_input: NoInput = False) -> None:
    """Write the one-file HTML report of a session from its results."""
    from tactile_lab import report as html_report
    from tactile_lab.cli.console import answer, emit_json

    del no_input
    path = html_report.write(choose_session(root, session).folder)
    if as_json:
        emit_json({"report": str(path)})
    else:
        answer(f"report  {path}")
