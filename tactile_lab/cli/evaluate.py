"""``tactile-lab evaluate``: judge a session again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def evaluate(
    session: Annotated[str, typer.Argument(help="A session's folder, its name under --root, or 'last'.")],
    root: Annotated[Path, typer.Option(help="Folder of sessions.")] = Path("runs"),
    as_json: Annotated[bool, typer.Option("--json", help="The evaluation as JSON on standard output.")] = False,
) -> None:
    """Judge a session's results against the markers in its recorded pictures and the object's true mesh."""
    from sessions.listing import find_session
    from tactile_lab.cli.results import show_evaluation
    from tactile_lab.workflow import evaluate_session

    show_evaluation(evaluate_session(find_session(root, session)), as_json)
