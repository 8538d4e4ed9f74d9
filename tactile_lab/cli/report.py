"""``tactile-lab report``: write a session's report again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def report(
    session: Annotated[str, typer.Argument(help="A session's folder, its name under --root, or 'last'.")],
    root: Annotated[Path, typer.Option(help="Folder of sessions.")] = Path("runs"),
    as_json: Annotated[bool, typer.Option("--json", help="The report's path as JSON on standard output.")] = False,
) -> None:
    """Write the one-file HTML report of a session from its results."""
    from sessions.listing import find_session
    from tactile_lab import report as html_report
    from tactile_lab.cli.console import emit_json, say

    path = html_report.write(find_session(root, session).folder)
    if as_json:
        emit_json({"report": str(path)})
    else:
        say(str(path))
