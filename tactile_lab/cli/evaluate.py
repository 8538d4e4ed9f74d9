"""``tactile-lab evaluate``: judge a session again."""

from __future__ import annotations

from pathlib import Path

from tactile_lab.cli.options import Json, NoInput, Root, SessionName


def evaluate(session: SessionName, root: Root = Path("runs"), as_json: Json = False, no_input: NoInput = False) -> None:
    """Judge a session's results against the markers in its recorded pictures and the object's true mesh."""
    from sessions.listing import find_session
    from tactile_lab.cli.results import conclude
    from tactile_lab.workflow.judging import evaluate_session

    del no_input
    conclude(evaluate_session(find_session(root, session)), as_json)
